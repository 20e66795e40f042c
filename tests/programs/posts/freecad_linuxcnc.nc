(Exported by FreeCAD)
(Post Processor: linuxcnc_post)
(Output Time:2026-11-24 08:15:00.123456)
(begin preamble)
G17 G54 G40 G49 G80 G90
G21
(begin operation: TC: Default Tool)
(machine units: mm/min)
(TC: Default Tool)
M5
M6 T1
G43 H1
M3 S3000
(finish operation: TC: Default Tool)
(begin operation: Drilling)
(machine units: mm/min)
G0 Z15.000
G90
G98
G0 X5.000 Y5.000
G0 Z7.000
G81 X5.000 Y5.000 Z-6.000 R3.000 F150.000
G80
G0 Z15.000
(finish operation: Drilling)
(begin operation: Pocket)
G0 X10.000 Y10.000
G1 X10.000 Y10.000 Z-1.000 F120.000
G3 X14.000 Y14.000 Z-1.500 I0.000 J4.000 K0.000 F240.000
G1 X10.000 Y14.000 Z-1.500
G0 Z15.000
(finish operation: Pocket)
(begin postamble)
M05
G17 G54 G90 G80 G40
M2
