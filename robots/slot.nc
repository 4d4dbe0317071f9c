%
O1 (a slot with round ends, and a straight seam back across it)
N10 G21 G17 G90 G94
N20 G0 X0 Y0
N30 G1 X80 F1200
N40 G3 X80 Y40 I0 J20
N50 G1 X0
N60 G3 X0 Y0 R20
N70 G1 X60 Y30 F600
M30
%
