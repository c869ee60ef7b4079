"""An impact that loses energy: f = k u^n (1 + lambda u').

K. H. Hunt and F. R. E. Crossley, Coefficient of restitution interpreted as damping in vibroimpact, Journal of Applied
Mechanics 42:440 (1975). The force begins and ends at zero, as that of a dashpot beside a spring does not. A body that
rebounds freely is slower than 1 / lambda, and its contact never pulls. The source does not speak of one that is torn
away faster; here its force is zero then, as that of every contact of camopt.
"""

from camopt.scene.contact_laws import hertz

LAW = hertz.LAW._replace(keys=("exponent", "dissipation_s_per_m"))
