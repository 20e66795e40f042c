%
O1234 (PROFILE)
(Exported by FreeCAD)
(Post Processor: fanuc_post)
(begin preamble)
G17 G54 G40 G49 G80 G90
G21
(begin operation: Fixture)
G54
(finish operation: Fixture)
(begin toolchange)
M5
G28 G91 Z0
G90
M6 T1
G43 H1
M3 S3000
(finish toolchange)
(begin operation: Profile)
G0 Z15.000
G0 X-3.000 Y-3.000
G0 Z3.000
G1 X-3.000 Y-3.000 Z-2.000 F120.000
G1 X-3.000 Y23.000 Z-2.000 F240.000
G2 X0.000 Y26.000 Z-2.000 I3.000 J0.000
G1 X20.000 Y26.000 Z-2.000
G0 Z15.000
(finish operation: Profile)
(begin postamble)
M05
G17 G54 G90 G80 G40
M6 T2
G80 G40
M2
%
