"""Where published values come from.

``seen`` says how a value reached this bench: ``"opened"``, the number was read in the text or the
abstract of the work itself or of one that quotes it (then ``through`` says which); ``"reference"``,
it stands in the reference values that this package is tested against, and the work itself was not
opened; ``"derived"``, it follows from statics in the lines given; ``"computed"``, another program
computed it for this bench.
"""

from __future__ import annotations

SOURCES: dict[str, dict[str, str]] = {
    "statics": {
        "citation": "Closed form from equilibrium and Coulomb's law; derived beside the generator.",
        "seen": "derived",
    },
    "own-lp": {
        "citation": "Linear program in SciPy's linprog (HiGHS) on matrices written apart from the "
        "package: benchmarks/baselines.py. No certificate.",
        "seen": "computed",
    },
    "own-cone": {
        "citation": "The cone of Eq. 24 in eight lines of CVXPY on matrices written apart from the "
        "package: bench/runners/plain_cvxpy.py. No certificate.",
        "seen": "computed",
    },
    "prototype": {
        "citation": "Independent prototype: linear programs on one complementarity piece each, "
        "2D; and sparse matrices apart from the package.",
        "seen": "reference",
    },
    "cocchetti-rizzi-2020": {
        "citation": "Cocchetti, G., Rizzi, E. (2020). Analytical and numerical analysis on the "
        "collapse modes of least-thickness circular masonry arches at decreasing friction. "
        "Frattura ed Integrità Strutturale 51, 356-375. Table 3.",
        "doi": "10.3221/IGF-ESIS.51.26",
        "seen": "opened",
    },
    "makris-alexakis-2013": {
        "citation": "Makris, N., Alexakis, H. (2013). The effect of stereotomy on the shape of "
        "the thrust-line and the minimum thickness of semicircular masonry arches. Archive of "
        "Applied Mechanics. Abstract.",
        "url": "https://discovery.researcher.life/article/the-effect-of-stereotomy-on-the-shape-of"
        "-the-thrustline-and-the-minimum-thickness-of-semicircular-masonry-arches/"
        "6117cf8804dd3164882302f2226587e1",
        "seen": "opened",
    },
    "paterson-zwick-2007": {
        "citation": "Paterson, M., Zwick, U. (2007). Overhang. arXiv:0710.2357. Harmonic stacks.",
        "doi": "10.48550/arXiv.0710.2357",
        "seen": "opened",
    },
    "portioli-2013": {
        "citation": "Portioli, F., Casapulla, C., Cascini, L., D'Aniello, M., Landolfo, R. "
        "(2013). Limit analysis by linear programming of 3D masonry structures with associative "
        "friction laws and torsion interaction effects. Archive of Applied Mechanics 83. "
        "Tables 8 and 10.",
        "url": "https://paperexplained.cn/articles/paper/detail/"
        "2a89294e16f02295d50bcc360e23f6c532df4728",
        "seen": "opened",
    },
    "restrepo-velez-2014": {
        "citation": "Restrepo Vélez, L. F., Magenes, G., Griffith, M. C. (2014). Dry stone masonry "
        "walls in bending - Part I: static tests. Int. J. Architectural Heritage 8(1), 1-28; "
        "the measured multipliers as printed in Portioli et al. (2013), Tables 8 and 10.",
        "url": "https://digital.library.adelaide.edu.au/dspace/handle/2440/89652",
        "seen": "opened",
        "through": "portioli-2013",
    },
    "ferris-tin-loi-2001": {
        "citation": "Ferris, M. C., Tin-Loi, F. (2001). Limit analysis of frictional block "
        "assemblies as a mathematical program with complementarity constraints. Int. J. "
        "Mechanical Sciences 43, 209-224. Associative values.",
        "doi": "10.1016/S0020-7403(99)00111-3",
        "seen": "reference",
    },
    "hybridfem": {
        "citation": "HybriDFEM, documentation: walls 1 and 2 of Ferris & Tin-Loi.",
        "url": "https://pypi.org/project/HybriDFEM/",
        "seen": "reference",
    },
    "portioli-2020": {
        "citation": "Portioli, F. (2020). Rigid block modelling of historic masonry structures "
        "using mathematical programming. Bulletin of Earthquake Engineering 18, 211-239. "
        "Figure 7: one block.",
        "doi": "10.1007/s10518-019-00722-0",
        "seen": "reference",
    },
    "mosek-optim": {
        "citation": "Wang, Q. mosek_optim: rigid block modelling of masonry structures using "
        "mathematical programming. Readme, studies 1 and 2; bonds and loads in its scripts.",
        "url": "https://github.com/qianqing-wanggg/mosek_optim",
        "seen": "opened",
    },
    "stockdale-2018": {
        "citation": "Stockdale, G., Tiberti, S., Camilletti, D., Sferrazza Papa, G., Basshofi "
        "Habieb, A., Bertolesi, E., Milani, G., Casolo, S. (2018). Kinematic collapse load "
        "calculator: circular arches. SoftwareX 7, 174-179.",
        "doi": "10.1016/j.softx.2018.05.006",
        "seen": "reference",
    },
    "page-1987": {
        "citation": "Page, J. (1987). Load tests to collapse on two arch bridges at Preston, "
        "Shropshire and Prestwood, Staffordshire. TRRL Research Report 110. Abstract.",
        "url": "https://trl.co.uk/reports/RR110",
        "seen": "opened",
    },
    "simoncello-2020": {
        "citation": "Simoncello, N., Zampieri, P., Gonzalez-Libreros, J., Perboni, S., Pellegrino, "
        "C. (2020). Numerical analysis of an FRP-strengthened masonry arch bridge. Frontiers in "
        "Built Environment 6.",
        "doi": "10.3389/fbuil.2020.00007",
        "seen": "reference",
    },
    "carozzi-2018": {
        "citation": "Carozzi, F. G., Poggi, C., Bertolesi, E., Milani, G. (2018). Ancient masonry "
        "arches and vaults strengthened with TRM, SRG and FRP composites: experimental evaluation. "
        "Composite Structures 187.",
        "doi": "10.1016/j.compstruct.2017.12.075",
        "seen": "reference",
    },
    "bertolesi-2018": {
        "citation": "Bertolesi, E., Milani, G., Carozzi, F. G., Poggi, C. (2018). Ancient masonry "
        "arches and vaults strengthened with TRM, SRG and FRP composites: numerical analyses. "
        "Composite Structures 187.",
        "doi": "10.1016/j.compstruct.2017.12.021",
        "seen": "reference",
    },
    "oliveira-2010": {
        "citation": "Oliveira, D. V., Basilio, I., Lourenço, P. B. (2010). Experimental behavior "
        "of FRP strengthened masonry arches. J. Composites for Construction 14(3); Basilio (2007).",
        "seen": "reference",
    },
    "borri-2011": {
        "citation": "Borri, A., Casadei, P., Castori, G., Hammond, J. (2011). Strengthening of "
        "brick masonry arches with externally bonded steel reinforced composites.",
        "seen": "reference",
    },
    "heyman-1967": {
        "citation": "Heyman's hemispherical dome of lunes under its own weight and later works: "
        "0.041 to 0.043 of the mean radius, by how the lune is cut.",
        "seen": "reference",
    },
    "portioli-exact": {
        "citation": "Portioli et al. (2013), Eq. 16 to 21 in closed form: the torsion arm, and the "
        "limit of torsion with shear on a contact pressed uniformly, checked by Monte Carlo.",
        "seen": "reference",
    },
}
"""Works by key; a DOI where it is known, else an address or neither."""
