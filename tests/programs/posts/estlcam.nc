(Project: Front panel)
(Created by Estlcam version 12 build 12,040)
(Machining time about 00:03:25 hours)
(Required tools:)
(Endmill 3mm)

G90
G00 Z5.0000
M00 (Change tool - please insert: Endmill 3mm)
M03 S24000
G04 P3.
(No. 1 Drill 1)
G00 X12.0000 Y8.0000
G00 Z0.5000
G01 Z-3.0000 F480 S24000
G00 Z0.5000
(No. 2 Part 1)
G01 X14.5000 Y8.0000 Z-1.0000 F1200
G02 X14.5000 Y8.0000 I-2.5000 J0.0000
G00 Z5.0000
M05
M30
