"""COMPAS assemblies, as objects or in JSON: compas_assembly, compas_cra, compas_dem, compas_model.

Objects are asked for their meshes. Files are read as plain data: no code of COMPAS runs, and no
object of it is made. In files an assembly is a graph whose nodes carry blocks; a block model is a
list of elements with materials. Layers named ``data`` (COMPAS 2) or ``value`` (COMPAS 1) wrap every
object. COMPAS 0.x has no such layers and no names of types: an assembly is a network beside a table
of its blocks, a mesh its vertices and faces.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.errors import InputError
from cvxlimit.extensions.importing.bodies import Body, natural
from cvxlimit.io.fields import mapping, number, parsed, read_bytes, shown

_WRAPPERS = ("data", "value")

_DEEPEST = 12
"""Wrapping layers, lists in lists, and levels of groups in a block model; real files have three."""


def bodies_of(model: Any) -> list[Body]:
    """The elements of a model, placed and cut by COMPAS, named by their numbers in its graph; for
    an assembly or meshes, what a file of them would hold."""
    if isinstance(model, (list, tuple)):
        return _listed(model, bodies_of)
    if not hasattr(model, "elements"):
        return read_compas(json.loads(model.to_jsonstring()))
    elements = [each for each in model.elements() if type(each).__name__ != "Group"]
    marked = any(getattr(each, "is_support", False) for each in elements)
    result = []
    for each in elements:
        mesh = each.modelgeometry
        if not hasattr(mesh, "to_vertices_and_faces"):
            kind = type(mesh).__name__
            raise InputError(f"element {each.graphnode} has a {kind} as geometry: mesh it first")
        vertices, faces = mesh.to_vertices_and_faces()
        support = bool(getattr(each, "is_support", False)) if marked else None
        density = getattr(each.material, "density", None)
        points = np.array(vertices, dtype=float).reshape(-1, 3)
        result.append(Body(str(each.graphnode), points, faces, support, density))
    return result


def is_object(value: object) -> bool:
    """Whether ``value`` is an object of COMPAS, or a list of such, or of lists of such."""
    while isinstance(value, (list, tuple)) and value:
        value = value[0]
    return hasattr(value, "to_jsonstring")


def is_compas(document: object) -> bool:
    """Whether a document, or each object in a list of lists, is one that COMPAS has written: with a
    ``dtype`` of its own, or, before COMPAS 1, with the keys of an assembly or of a mesh."""
    leaves = [leaf for _, leaf in _leaves(document)]
    for leaf in leaves:
        if not isinstance(leaf, dict):
            return False
        is_old = leaf.keys() >= {"assembly", "blocks"} or leaf.keys() >= {"vertex", "face"}
        if not is_old and "compas" not in str(leaf.get("dtype", "")):
            return False
    return bool(leaves)


def _leaves(value: Any, places: tuple[str, ...] = ()) -> Iterator[tuple[str, Any]]:
    """Each object in a list, or in lists in it, with its place: "2.0" is the first of the third.
    What is no list is the one object, with an empty place."""
    if not isinstance(value, (list, tuple)):
        yield ".".join(places), value
        return
    if len(places) > _DEEPEST:
        raise InputError("lists of blocks are nested too deeply; flatten them")
    for i, each in enumerate(value):
        yield from _leaves(each, (*places, str(i)))


def _listed(value: object, bodies: Callable[[Any], list[Body]]) -> list[Body]:
    """The ``bodies`` of all objects in a list, named by their places; those of an assembly in it by
    their nodes as well."""
    return [
        replace(body, name=f"{place}.{body.name}" if body.name else place)
        for place, leaf in _leaves(value)
        for body in bodies(leaf)
    ]


def read_json(path: Path, notes: list[str]) -> list[Body]:
    """The blocks of a file of COMPAS. All readers have ``notes``; this one adds none."""
    document = parsed(read_bytes(path))
    if isinstance(document, dict) and document.get("format") == "cvxlimit-scene":
        raise InputError("this is a scene already: solve it, there is nothing to import")
    if not is_compas(document):
        raise InputError(
            "this JSON holds no blocks that are known: neither a 'dtype' of COMPAS nor, as its "
            "versions before 1 write them, 'assembly' beside 'blocks', or 'vertex' beside 'face'"
        )
    return read_compas(document)


def read_compas(document: object) -> list[Body]:
    """The blocks of a document: a list, an assembly of COMPAS 0.x, a mesh, a block model or an
    assembly, whichever its keys tell. Raises InputError for any other."""
    if isinstance(document, list):
        return _listed(document, read_compas)
    content = _content(document)
    if "assembly" in content and "blocks" in content:
        return _of_network(content)
    if "vertex" in content and "face" in content:
        return [_block("", content, None, None)]
    if "elements" in content:
        return list(_of_model(content))
    graph = _content(content.get("graph", content))
    nodes = graph.get("node")
    if not isinstance(nodes, dict) or not nodes:
        raise InputError(
            "the COMPAS file has neither elements nor a graph of blocks: write an assembly or a "
            "block model"
        )
    return _of_assembly(nodes)


def _of_assembly(nodes: Mapping[str, Any]) -> list[Body]:
    """The blocks of an assembly's nodes, in their natural order."""
    marked = any(isinstance(n, dict) and n.get("is_support") for n in nodes.values())
    result = []
    for key, node in sorted(nodes.items(), key=lambda item: natural(item[0])):
        if not isinstance(node, dict) or node.get("block") is None:
            raise InputError(f"node {shown(key)} of the assembly has no block")
        mesh = _content(node["block"])
        attributes = mesh.get("attributes")
        own = attributes.get("density") if isinstance(attributes, dict) else None
        support = bool(node.get("is_support")) if marked else None
        result.append(_block(key, mesh, support, node.get("density", own)))
    return result


def _of_network(content: Mapping[str, Any]) -> list[Body]:
    """The blocks of a network as COMPAS 0.x writes it; some versions call its nodes vertices."""
    network = mapping(content["assembly"], "the assembly")
    nodes = mapping(network.get("node") or network.get("vertex") or {}, "nodes of the assembly")
    blocks = mapping(content["blocks"], "blocks of the assembly")
    for key in nodes:
        if key not in blocks:
            raise InputError(f"node {shown(key)} of the assembly has no block")
    if not blocks:
        raise InputError("the assembly has no blocks")
    joined = dict[str, Any]()
    for key, block in blocks.items():
        joined[key] = {**mapping(nodes.get(key, {}), f"node {shown(key)}"), "block": block}
    return _of_assembly(joined)


def _of_model(content: Mapping[str, Any]) -> Iterator[Body]:
    """The blocks of a block model, named by their numbers among its elements."""
    elements = mapping(content["elements"], "elements of the block model")
    materials = mapping(content.get("materials") or {}, "materials of the block model")
    densities = {key: _content(value).get("density") for key, value in materials.items()}
    marked = any(_content(element).get("is_support") for element in elements.values())
    whole = _transformation(content.get("transformation"), "the block model")
    tree = content.get("tree")
    root = tree.get("root") if isinstance(tree, dict) else None
    placed = dict(_placed(root, elements, whole)) if isinstance(root, dict) else {}
    for place, key in enumerate(elements):
        name, element = str(place), _content(elements[key])
        if element.get("features"):
            raise InputError(
                f"block {name!r} has features (cuts or joints), which only COMPAS can apply: "
                "write the finished meshes"
            )
        if element.get("geometry") is None:
            continue  # a group
        own = _transformation(element.get("transformation"), f"block {name!r}")
        material = element.get("material")
        yield _block(
            name,
            _content(element["geometry"]),
            bool(element.get("is_support")) if marked else None,
            densities.get(material) if isinstance(material, str) else None,
            placed.get(key, whole) @ own,
        )


def _placed(
    node: Mapping[str, Any], elements: Mapping[str, Any], above: FloatArray, depth: int = 0
) -> Iterator[tuple[str, FloatArray]]:
    """The key of each element below a node of a tree of groups, and the transformation (4, 4) of
    all groups that it is in, ``above`` among them, without its own."""
    if depth > _DEEPEST:
        raise InputError("groups of the block model are nested too deeply; flatten them")
    key, children = node.get("element"), node.get("children")
    if isinstance(key, str) and key in elements:
        yield key, above
        own = _content(elements[key]).get("transformation")
        above = above @ _transformation(own, f"element {shown(key)}")
    for child in children if isinstance(children, list) else ():
        if isinstance(child, dict):
            yield from _placed(child, elements, above, depth + 1)


def _block(
    name: str,
    mesh: Mapping[str, Any],
    is_support: bool | None,
    density: object,
    transformation: FloatArray | None = None,
) -> Body:
    """The body of a mesh whose vertices and faces stand in tables, moved by a transformation."""
    where = f"block {shown(name)}"
    if "vertex" not in mesh or "face" not in mesh:
        raise InputError(f"{where} is no mesh of vertices and faces: convert it to one")
    vertices = mapping(mesh["vertex"], f"vertices of {where}")
    place = {key: i for i, key in enumerate(vertices)}
    rows = []
    for key, vertex in vertices.items():
        point = mapping(vertex, f"vertex {shown(key)} of {where}")
        rows.append(
            [number(point.get(x, 0.0), f"{x} of vertex {shown(key)} of {where}") for x in "xyz"]
        )
    faces = []
    for key, face in mapping(mesh["face"], f"faces of {where}").items():
        if not isinstance(face, list):
            raise InputError(f"face {shown(key)} of {where} must be a list, got {shown(face)}")
        for v in face:
            if str(v) not in place:
                raise InputError(
                    f"face {shown(key)} of {where} names vertex {shown(v)}, which is not there"
                )
        faces.append([place[str(v)] for v in face])
    points = np.array(rows, dtype=float).reshape(-1, 3)
    if transformation is not None:
        points = points @ transformation[:3, :3].T + transformation[:3, 3]
    stated = None if density is None else number(density, f"density of {where}")
    return Body(name, points, faces, is_support, stated)


def _transformation(value: object, where: str) -> FloatArray:
    """A transformation as a matrix (4, 4); the identity for None."""
    if value is None:
        return np.eye(4)
    try:
        matrix = np.array(_content(value).get("matrix"), dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"the transformation of {where} must be a 4 x 4 matrix") from error
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise InputError(f"the transformation of {where} must be a 4 x 4 matrix of finite numbers")
    return matrix


def _content(value: object) -> dict[str, Any]:
    """An object without the layers that wrap it."""
    for _ in range(_DEEPEST):
        if not isinstance(value, dict):
            break
        inner = next((value[w] for w in _WRAPPERS if isinstance(value.get(w), dict)), None)
        if inner is None or ("dtype" not in value and "datatype" not in value):
            return value
        value = inner
    raise InputError(f"a COMPAS object must be an object {{...}}, got {shown(value)}")
