"""After the collapse load factor: the path of a structure in finite displacements, its code check.

Its doors are ``cvxlimit.commands`` (``pushover``), ``cvxlimit.readings``, ``cvxlimit.documents``,
``cvxlimit.files`` and ``cvxlimit.proofs``. To read: ``configuration.py`` and ``path.py``, the
result, and ``moving.py``, its scenes; ``pairs.py``, ``points.py``, ``bars.py`` and ``bonds.py``,
contacts of displaced blocks, ties, reactions and cohesion; ``starting.py``, where a path begins,
``loads.py`` and ``supports.py``, loads and supports that move; ``increment.py``, a convex step;
``resting.py``, iterates of it; ``following.py`` and ``jumps.py``, steps and snaps, ``between.py``,
what is between two of them; ``proximal.py``, explicit steps where nothing comes to rest;
``runs.py`` and ``notes.py``, a run, and what is to say of it; ``pushover.py``, the call, with
``refusing.py``; ``fitting.py``, which motion of supports was it; ``proof.py`` and ``proving.py``;
``code_check.py`` and its result in ``checked.py``, with ``oscillator.py`` and ``sliding.py``;
``wording.py``, a path in words; ``files.py``, ``tables.py``, ``pictures.py`` and ``command.py``.
"""

from cvxlimit.base.doors import Offered

OFFERED: Offered = {
    "cvxlimit.commands": {"pushover": "cvxlimit.extensions.paths.command:PushoverCommand"},
    "cvxlimit.documents": {"path": "cvxlimit.extensions.paths.files:PATH"},
    "cvxlimit.files": {
        "read_path": "cvxlimit.extensions.paths.files:read_path",
        "write_path": "cvxlimit.extensions.paths.files:write_path",
    },
    "cvxlimit.proofs": {"cvxlimit-path": "cvxlimit.extensions.paths.proving:prove_path"},
    "cvxlimit.readings": {
        "path_facts": "cvxlimit.extensions.paths.wording:facts",
        "path_followed": "cvxlimit.extensions.paths.wording:followed",
        "path_headline": "cvxlimit.extensions.paths.wording:headline",
        "path_interval": "cvxlimit.extensions.paths.wording:interval",
        "path_table": "cvxlimit.extensions.paths.tables:path_table",
        "path_save": "cvxlimit.extensions.paths.files:write_path",
        "path_plot": "cvxlimit.extensions.paths.pictures:draw_path",
        "check_plot": "cvxlimit.extensions.paths.pictures:draw_check",
    },
}
