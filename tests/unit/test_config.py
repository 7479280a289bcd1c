"""Design files: reading, bases, overrides, refusals, the resolved file, digests, the schema and the presets."""

from __future__ import annotations

import json
import math
import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

from fem_biobot.config import PRESETS, digest, geometry_digest, json_schema, load_design, presets, to_toml
from fem_biobot.design import Design, keys
from fem_biobot.errors import DesignError, FileError

NAMES = ("junction_bot", "ring_bot", "elastica_walker", "strip", "cantilever")

# sections that the junction bot does not have
ABSENT = ("walker.", "muscle.oxygen.", "muscle.tissue.", "muscle.force_velocity.", "muscle.activation.")


def write(folder: Path, text: str, name: str = "mine.toml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def refusal(name_or_path: str | Path, *overrides: str, error: type[Exception] = DesignError) -> str:
    """Message with which a design is refused; one line by assertion."""
    with pytest.raises(error) as caught:
        load_design(name_or_path, overrides)
    message = str(caught.value)
    assert "\n" not in message
    return message


# ---------------------------------------------------------------- presets


def test_presets_are_listed_in_order_with_a_line_each() -> None:
    """The four presets, the reference machine first.

    Catches: a preset file that is not found, an empty description.
    """
    assert tuple(presets()) == NAMES
    assert all(len(line) > 20 for line in presets().values())


@pytest.mark.parametrize("name", NAMES)
def test_presets_load_under_their_name(name: str) -> None:
    """Each preset is a valid design that carries its file's name.

    Catches: a preset that a new check refuses.
    """
    assert load_design(name).name == name


@pytest.mark.parametrize("name", NAMES)
def test_every_preset_value_names_its_source(name: str) -> None:
    """Every value line ends in a comment with a file of facts or the word assumption.

    Catches: a number put into a preset without a source.
    """
    text = (PRESETS / f"{name}.toml").read_text(encoding="utf-8")
    assert text.startswith("#:schema ./design.schema.json\n")
    values = [line for line in text.splitlines() if re.match(r"\w+ *=", line)]
    titles = ("name", "description", "kind")
    sourced = [line for line in values if line.split()[0] not in titles]
    assert len(sourced) >= 10
    for line in sourced:
        assert re.search(r"# .*(facts/\w+\.csv: \w|assumption)", line), line


def test_every_preset_value_reads_as_written() -> None:
    """Spot values of the reference machine arrive in coherent units.

    Catches: a unit or a value mistyped in the preset.
    """
    bot = load_design("junction_bot")
    expected = {
        "skeleton.beam_thickness": 0.68,
        "skeleton.material.young": 319.4,
        "skeleton.material.density": 1.12e-6,
        "muscle.material.density": 1.06e-6,
        "muscle.theta": math.pi / 2,
        "muscle.passive_tension": 9.09,
        "muscle.ring_offset": -0.1,
        "drive.frequency": 2.0,
        "numerics.step": 1e-3,
        "ground.medium_density": 1e-6,
    }
    assert {name: bot.value(name) for name in expected} == expected


# ---------------------------------------------------------------- files and bases


def test_a_file_may_start_from_a_preset(tmp_path: Path) -> None:
    """With a base only the keys that differ are given; the name is the file's.

    Catches: a section replaced as a whole, the base's name kept.
    """
    path = write(tmp_path, 'base = "junction_bot"\n[muscle]\ntheta = "80 deg"\n[muscle.material]\npoisson = 0.48\n')
    mine, bot = load_design(path), load_design("junction_bot")
    assert mine.name == "mine"
    differing = {name for name in keys() if mine.value(name) != bot.value(name)}
    assert differing == {"name", "description", "muscle.theta", "muscle.material.poisson"}
    assert load_design("junction_bot") == bot


def test_a_base_is_found_beside_its_file(tmp_path: Path) -> None:
    """A base given as a path is relative to the file that names it; bases may be stacked.

    Catches: a base looked for in the working directory, only one level followed.
    """
    (tmp_path / "sub").mkdir()
    write(tmp_path, 'base = "junction_bot"\n[muscle]\ngamma = 0.7\ntheta = "70 deg"\n', "lower.toml")
    path = write(tmp_path / "sub", 'base = "../lower.toml"\n[muscle]\ntheta = "80 deg"\n')
    mine = load_design(path)
    assert mine.value("muscle.gamma") == 0.7
    assert mine.value("muscle.theta") == pytest.approx(math.radians(80), rel=1e-15)


def test_bases_that_lead_nowhere_are_refused(tmp_path: Path) -> None:
    """A circle of bases, a base that is no text and a base that does not exist end in one line each.

    Catches: endless recursion, a silent start from nothing.
    """
    write(tmp_path, 'base = "b.toml"\n', "a.toml")
    write(tmp_path, 'base = "a.toml"\n', "b.toml")
    assert "base: found a.toml, which leads back to itself" in refusal(tmp_path / "a.toml")
    assert "base: found 3, expected the name of a preset" in refusal(write(tmp_path, "base = 3\n"))
    missing = refusal(write(tmp_path, 'base = "junction_bott"\n'), error=FileError)
    assert "did you mean junction_bot?" in missing


def test_byte_order_mark_and_windows_line_ends_are_read(tmp_path: Path) -> None:
    """A file from a Windows editor is a design like any other.

    Catches: utf-8 without -sig.
    """
    path = tmp_path / "mine.toml"
    path.write_bytes(b'\xef\xbb\xbfbase = "strip"\r\n[muscle]\r\ngamma = 0.5\r\n')
    assert load_design(path).value("muscle.gamma") == 0.5


def test_missing_files_are_answered_with_the_presets(tmp_path: Path) -> None:
    """A name that is neither preset nor file lists the presets; a folder is no design.

    Catches: a bare "no such file".
    """
    message = refusal("junction_bo", error=FileError)
    assert message.startswith("junction_bo: no such file or preset")
    assert "junction_bot, ring_bot, elastica_walker, strip, cantilever; did you mean junction_bot?" in message
    assert "no such file or preset" in refusal(tmp_path / "nothing.toml", error=FileError)
    assert "found a folder, expected a TOML file" in refusal(tmp_path, error=FileError)
    assert "found no regular file" in refusal("/dev/null", error=FileError)
    assert "cannot be read (File name too long)" in refusal("x" * 300, error=FileError)
    assert FileError.exit_code == DesignError.exit_code == 2


def test_unreadable_files_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bytes that are no text, a file far too large and one that may not be read end in one line.

    Catches: UnicodeDecodeError or PermissionError reaching the user, a gigabyte read into memory.
    """
    path = tmp_path / "mine.toml"
    path.write_bytes(b"\xff\xfe\x00")
    assert "mine.toml: found bytes that are not UTF-8 text" in refusal(path, error=FileError)
    path.write_bytes(b"#" * 1_000_001)
    assert "found 1000001 bytes, expected a design file of at most 1000000" in refusal(path, error=FileError)
    path.write_text("")

    def forbidden(*_: object, **__: object) -> str:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "read_text", forbidden)
    assert "mine.toml: cannot be read (Permission denied)" in refusal(path, error=FileError)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('kind = "bot"\n[muscle]\ntheta = 90 deg\n', "mine.toml, line 3: not valid TOML: expected newline"),
        (
            'base = "strip"\nname = "a"\nname = "b"\n',
            "mine.toml, line 3: found a key or section again, expected it once",
        ),
        ("[muscle]\n\n[mesh]\n[muscle]\n", "mine.toml, line 4: found a key or section again"),
        ('kind = "bot\n', "mine.toml, line 1: not valid TOML"),
        ("kind =", "mine.toml, line 1: not valid TOML: invalid value"),
        ("\n\n[muscle", "mine.toml, line 3: not valid TOML"),
        ("mesh = " + "[" * 3000, "values nested too deeply"),
        ("pillars = " + "1" * 5000, "not valid TOML: exceeds the limit"),
    ],
)
def test_text_that_is_no_toml_is_refused_with_its_line(tmp_path: Path, text: str, words: str) -> None:
    """Malformed and duplicated text is refused with file and line.

    Catches: the parser's own exception reaching the user, a line number lost.
    """
    assert words in refusal(write(tmp_path, text))


# ---------------------------------------------------------------- keys and values in files


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[skeleton]\nbeam_lenght = 3\n", "skeleton.beam_lenght: unknown key; did you mean skeleton.beam_length?"),
        ("[skelton]\nbeam_length = 3\n", "skelton: unknown section; did you mean skeleton?"),
        ("[muscle.materials]\nyoung = 3\n", "muscle.materials: unknown section; did you mean muscle.material?"),
        ('beam_length = "14 mm"\n', "beam_length: unknown key; did you mean skeleton.beam_length?"),
        ('"a\\nb" = 1\n', "a\\nb: unknown key, expected one of: name, description, kind, skeleton"),
        ("skeleton = 3\n", "skeleton: found 3, expected a section with keys such as skeleton.beam_length"),
        ("[[muscle]]\ngamma = 1.0\n", "muscle: found a list, expected a section"),
        ("[skeleton]\nbeam_length = 14\n", 'skeleton.beam_length: found 14 (no unit), expected a length with its unit'),
        ("[skeleton.beam_length]\nmm = 14\n", "skeleton.beam_length: found a section, expected a length"),
        ("[mesh]\nsize = 1979-05-27\n", "mesh.size: found 1979-05-27, expected a length"),
        ("[muscle]\ngamma = true\n", "muscle.gamma: found true, expected a number"),
        ("[muscle]\ngamma = nan\n", "muscle.gamma: found nan (not finite)"),
        ("[muscle]\ngamma = 1.2\n", "muscle.gamma: found 1.2, expected between 0 and 1"),
        ('[muscle]\ntheta = "200 deg"\n', "muscle.theta: found 200 deg, expected between 0 deg and 180 deg"),
        ("[muscle]\nreference = 3\n", "muscle.reference: found 3, expected one of: as_moulded, remodelled"),
        ("[skeleton]\npillar_count = 2.5\n", "skeleton.pillar_count: found 2.5, expected a whole number"),
        ("name = 3\n", "name: found 3, expected a text"),
    ],
)  # fmt: skip
def test_wrong_keys_and_values_are_refused_by_full_name(tmp_path: Path, text: str, message: str) -> None:
    """What a file says wrongly is refused with the dotted key, the finding and the expectation.

    Catches: a key without its section in the message, an unknown key ignored.
    """
    path = write(tmp_path, 'base = "junction_bot"\n' + text)
    assert refusal(path).startswith(message)


def test_required_keys_that_are_missing_are_named_with_their_unit(tmp_path: Path) -> None:
    """A file without base that lacks a key is told which, with an example in its unit.

    Catches: a default put in the place of a dimension.
    """
    complete = to_toml(load_design("junction_bot"))
    for key, words in {
        "beam_length": 'skeleton.beam_length: missing, expected a length with its unit, such as "14 mm"',
        "ring_height": "muscle.ring_height: missing, expected a length with its unit",
        "pillar_width": "skeleton.pillar_width: missing, expected a length",
        "theta": 'muscle.theta: missing, expected an angle with its unit, such as "90 deg"',
        "passive_tension": "muscle.passive_tension: missing, expected a stress with its unit",
        "kind": "kind: missing, expected one of: bot, strip, cantilever, walker",
        "size": "mesh.size: missing, expected a length",
        "poisson": "skeleton.material.poisson: missing, expected a number",
    }.items():
        without = re.sub(rf"^{key} = .*\n", "", complete, flags=re.MULTILINE)
        assert refusal(write(tmp_path, without)).startswith(words)
    assert refusal(write(tmp_path, 'kind = "bot"\n[mesh]\nsize = "1 mm"\n')).startswith("skeleton: missing")
    assert refusal(write(tmp_path, "")).endswith(": missing, expected one of: bot, strip, cantilever, walker")
    load = 'base = "cantilever"\n[load]\n'
    assert load_design(write(tmp_path, load)).value("load.tip_force") == 0.01


# ---------------------------------------------------------------- overrides


@pytest.mark.parametrize(
    ("override", "key", "value"),
    [
        ("muscle.theta=80 deg", "muscle.theta", 80 * math.pi / 180),
        ('muscle.theta="80 deg"', "muscle.theta", 80 * math.pi / 180),
        ("muscle.theta='80deg'", "muscle.theta", 80 * math.pi / 180),
        (" muscle.theta = 80deg ", "muscle.theta", 80 * math.pi / 180),
        ("muscle.gamma=0.9", "muscle.gamma", 0.9),
        ("muscle.gamma=90%", "muscle.gamma", 0.9),
        ("muscle.reference=remodelled", "muscle.reference", "remodelled"),
        ('muscle.reference="remodelled"', "muscle.reference", "remodelled"),
        ("skeleton.pillar_count=3", "skeleton.pillar_count", 3),
        ("skeleton.material.young=0.3 MPa", "skeleton.material.young", 300.0),
        ("name=a = b", "name", "a = b"),
    ],
)
def test_overrides_set_one_key(override: str, key: str, value: object) -> None:
    """``key=value unit`` with or without quotes changes that key and no other.

    Catches: quotes kept in the value, a split at the last equals sign, a number left as text.
    """
    bot, mine = load_design("junction_bot"), load_design("junction_bot", [override])
    found = mine.value(key)
    assert found == (pytest.approx(value, rel=1e-15) if isinstance(value, float) else value)
    assert {name for name in keys() if mine.value(name) != bot.value(name)} == {key}


def test_the_last_override_counts() -> None:
    """Overrides apply in order, after the file, without touching the preset.

    Catches: the first one winning, a cached table changed.
    """
    mine = load_design("junction_bot", ["muscle.gamma=0.5", "muscle.gamma=0.6"])
    assert mine.value("muscle.gamma") == 0.6
    assert load_design("junction_bot").value("muscle.gamma") == 1.0


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("muscle.theta", '--set: found "muscle.theta", expected key=value, such as muscle.theta="90 deg"'),
        ("=3", '--set: found "=3", expected key=value'),
        ("muscle=3", "muscle: found a single value, expected one of its keys, such as muscle.layout"),
        ("muscle.thetta=3 deg", "muscle.thetta: unknown key; did you mean muscle.theta?"),
        ("muscle.theta.x=3 deg", "muscle.theta.x: unknown key"),
        ("base=strip", "base: unknown key"),
        ("muscle.theta=90", 'muscle.theta: found "90" (no unit), expected an angle'),
        ("muscle.theta=", 'muscle.theta: found "" (not a number with a unit)'),
        ("muscle.gamma=nine", 'muscle.gamma: found "nine"'),
        ("skeleton.pillar_count=many", 'skeleton.pillar_count: found "many", expected a whole number'),
        (
            "muscle.material.poisson=0.5",
            "muscle.material.poisson: found 0.5, expected between 0 and 0.499 with mesh.element",
        ),
        ("load.tip_force=1 mN", 'load: found a section, expected none for kind "bot"'),
    ],
)
def test_wrong_overrides_are_refused(override: str, message: str) -> None:
    """An override that is malformed, unknown or out of range is refused like a file's value.

    Catches: an unknown key created, a section overwritten by text.
    """
    assert refusal("junction_bot", override).startswith(message)


def test_an_override_below_a_value_that_is_no_section_is_refused(tmp_path: Path) -> None:
    """A file in which a section is a number cannot be overridden into shape.

    Catches: an AttributeError or a silent replacement.
    """
    path = write(tmp_path, 'base = "junction_bot"\nmuscle = 3\n')
    assert refusal(path, "muscle.gamma=0.9").startswith("muscle: found 3, expected a section")


# ---------------------------------------------------------------- the resolved file and the digests


GENERIC = (
    "muscle.theta=81.234567890123 deg",
    "skeleton.beam_length=14.1 mm",
    "muscle.gamma=0.1234567890123456789",
    "skeleton.material.density=1.1234567e-3 g/mm^3",
    "muscle.passive_tension=7.7 psi",
    "drive.duration=1.1 min",
    "skeleton.fillet_radius=0.0123 inch",
    "ground.immersion=submerged",
    "ground.viscosity=0.8937 cP",
    'name=odd "name" \\ ü',
)


@pytest.mark.parametrize("name", NAMES)
def test_the_resolved_file_reads_back_as_the_identical_design(tmp_path: Path, name: str) -> None:
    """Every preset written out and read in again is equal, digest included.

    Catches: a key not written, a kind without its section.
    """
    design = load_design(name)
    again = load_design(write(tmp_path, to_toml(design)))
    assert again == design
    assert digest(again) == digest(design)
    assert to_toml(again) == to_toml(design)


def test_generic_values_survive_the_resolved_file_exactly(tmp_path: Path) -> None:
    """Floats with all their digits, foreign units and odd names come back bit for bit.

    Catches: digits lost in writing, a quote in a name not escaped.
    """
    design = load_design("junction_bot", GENERIC)
    assert load_design(write(tmp_path, to_toml(design))) == design
    # an angle that no short number of degrees gives
    turned = design.with_values({"muscle.theta": math.nextafter(1.2345678901234567, 2.0)})
    assert load_design(write(tmp_path, to_toml(turned))) == turned


def test_the_resolved_file_holds_every_key_of_its_kind_with_units() -> None:
    """All keys that a bot has are written, dimensional ones as text with a unit; no viscosity where none is given.

    Catches: defaults left out, a bare number for a length.
    """
    table = tomllib.loads(to_toml(load_design("junction_bot")))
    written = {
        ".".join((*path, name)): value
        for path, section in [((), table), *(((s,), t) for s, t in table.items() if isinstance(t, dict))]
        for name, value in section.items()
        if not isinstance(value, dict)
    }
    for part in ("skeleton", "muscle"):
        written |= {f"{part}.material.{name}": value for name, value in table[part]["material"].items()}
    optional = {name for name, key in keys().items() if key.field.default is None}
    assert {"ground.viscosity", "muscle.optimal_stretch", "skeleton.material.c2"} < optional
    # sections that this machine does not have
    absent = {name for name in keys() if name.startswith(ABSENT)}
    assert set(written) == set(keys()) - {"muscle.junction_length", "load.tip_force"} - optional - absent
    for name, value in written.items():
        quantity = keys()[name].quantity
        if quantity is not None:
            assert isinstance(value, str) == (quantity.unit != "1"), name


def test_the_digest_is_blind_to_units_order_and_names(tmp_path: Path) -> None:
    """The same machine in other units, order, formatting and under another name has the same digest.

    Catches: hashing the text, hashing rounded conversions, the name in the digest.
    """
    one = to_toml(load_design("junction_bot"))
    two = one
    for old, new in {
        '"14 mm"': '"1.4 cm"',
        '"0.68 mm"': '"680 um"',
        '"319.4 kPa"': '"319400 Pa"',
        '"9.09 kPa"': '"9.09 mN/mm^2"',
        '"90 deg"': '"1.5707963267948966 rad"',
        '"0.00112 g/mm^3"': '"1120 kg/m^3"',
        '"0.001 s"': '"1 ms"',
        '"2 Hz"': '"120 1/min"',
        "poisson = 0.45": 'poisson = "45 %"',
        'name = "junction_bot"': 'name = "other"',
        "gamma = 1\n": "gamma   =   1.0   # viable\n",
    }.items():
        assert old in two
        two = two.replace(old, new)
    head, *parts = re.split(r"\n(?=\[)", two)
    path = write(tmp_path, "\n".join([head, *reversed(parts)]))
    assert digest(load_design(path)) == digest(load_design("junction_bot"))
    assert re.fullmatch(r"[0-9a-f]{16}", digest(load_design("junction_bot")))


CHANGES: dict[str, Any] = {
    "skeleton.pillar_count": 3,
    "muscle.reference": "remodelled",
    "muscle.fibres": "smooth",
    "muscle.ring_offset": -0.2,
    "drive.waveform": "constant",
    "ground.immersion": "submerged",
    "kind": None,
    "drive.pulses": None,
    "muscle.layout": None,
    "muscle.orientation_axis": None,
    "muscle.junction_length": None,
    "load.tip_force": None,
}


def test_the_digest_sees_every_key() -> None:
    """Changing any one key of the machine changes the digest; the last bit of a float suffices.

    Catches: a key left out, floats rounded before hashing.
    """
    bot = load_design("junction_bot", ["skeleton.pillar_width=6 mm", "drive.fatigue_time=20 s"])
    seen = {digest(bot)}
    changed = 0
    for name, key in keys().items():
        value = CHANGES.get(name, bot.value(name))
        if name in ("name", "description") or value is None or (key.choices and name not in CHANGES):
            continue
        if name not in CHANGES:
            value = value * (1 - 1e-12) if value else 1e-3
        seen.add(digest(bot.with_values({name: value})))
        changed += 1
    assert changed > 30
    assert len(seen) == changed + 1
    nearest = math.nextafter(14.0, 15.0)
    assert digest(bot.with_values({"skeleton.beam_length": nearest})) != digest(bot)
    burst = bot.with_values({"drive.waveform": "twitch", "drive.pulses": 2, "drive.pulse_rate": 9.0})
    assert digest(burst.with_values({"drive.pulses": 3})) != digest(burst)
    wet = bot.with_values({"ground.immersion": "submerged"})
    assert digest(wet.with_values({"ground.viscosity": 0.0})) != digest(wet)


def test_the_geometry_digest_sees_shape_alone() -> None:
    """Lengths, count and layout change it; material, tension, fibre angle and mesh size do not.

    Catches: a committed mesh refused for another tension, or taken for another shape.
    """
    bot = load_design("junction_bot", ["skeleton.pillar_width=6 mm"])
    same = [
        "skeleton.pillar_width=0.6 cm",
        "muscle.theta=70 deg",
        "muscle.gamma=0.5",
        "muscle.passive_tension=1 kPa",
        "muscle.reference=remodelled",
        "skeleton.material.young=1 kPa",
        "muscle.material.poisson=0.3",
        "mesh.size=0.3 mm",
        "drive.frequency=4 Hz",
        "ground.static_friction=0.5",
        "name=x",
    ]
    assert geometry_digest(load_design("junction_bot", same)) == geometry_digest(bot)
    seen = {geometry_digest(bot)}
    lengths = [
        name
        for name, key in keys().items()
        if name.startswith(("skeleton.", "muscle."))
        and str(key.field.description).endswith("[mm]")
        and not name.startswith(("muscle.tissue.", "muscle.activation."))
    ]
    lengths.remove("muscle.junction_length")
    for name in lengths:
        seen.add(geometry_digest(bot.with_values({name: bot.value(name) * 0.999 or 1e-3})))
    seen.add(geometry_digest(bot.with_values({"skeleton.pillar_count": 3})))
    assert len(lengths) == 14
    assert len(seen) == len(lengths) + 2
    assert len({geometry_digest(load_design(name)) for name in NAMES}) == len(NAMES)
    seeded = load_design("junction_bot", ["muscle.tissue.seeded_width=7 mm"])
    stated = load_design("junction_bot", [f"muscle.junction_width={seeded.value('muscle.junction_width')!r} mm"])
    assert geometry_digest(seeded) == geometry_digest(stated)


# ---------------------------------------------------------------- the schema


def test_the_schema_file_is_up_to_date() -> None:
    """The copy beside the presets is what the records say.

    Catches: a key added without renewing the file. Renew it by writing `json_schema()` with indent 2.
    """
    text = (PRESETS / "design.schema.json").read_text(encoding="utf-8")
    assert text == json.dumps(json_schema(), indent=2, ensure_ascii=False) + "\n"


def accepts(schema: dict[str, Any], value: object) -> bool:
    """The part of JSON schema that ours uses."""
    if "anyOf" in schema and "properties" not in schema:
        return any(accepts(option, value) for option in schema["anyOf"])
    if "enum" in schema:
        return value in schema["enum"]
    match schema["type"]:
        case "object":
            inside = isinstance(value, dict) and set(value) <= set(schema["properties"])
            return inside and all(accepts(schema["properties"][k], v) for k, v in value.items())  # type: ignore[union-attr]
        case "integer":
            return isinstance(value, int)
        case "number":
            number = isinstance(value, int | float) and not isinstance(value, bool)
            return number and schema.get("minimum", -math.inf) <= value <= schema.get("maximum", math.inf)
        case _:
            return isinstance(value, str) and re.search(schema.get("pattern", ""), value) is not None


@pytest.mark.parametrize("name", NAMES)
def test_the_schema_accepts_presets_and_resolved_files(name: str) -> None:
    """An editor finds no fault in what the package ships and writes.

    Catches: a pattern too narrow, a key missing from the schema.
    """
    schema = json_schema()
    assert accepts(schema, tomllib.loads((PRESETS / f"{name}.toml").read_text(encoding="utf-8")))
    assert accepts(schema, tomllib.loads(to_toml(load_design(name))))


@pytest.mark.parametrize(
    "text",
    [
        "[skeleton]\nbeam_lenght = '14 mm'",
        "[skeleton]\nbeam_length = 14",
        "[skeleton]\nbeam_length = '14'",
        "[skeleton]\nbeam_length = 'mm'",
        "[skeleton]\nbeam_length = '1,4 mm'",
        "[muscle]\ngamma = 1.2",
        "[muscle]\ngamma = '1 mm'",
        "[muscle]\nconvention = 'kirchhof'",
        "[skeleton]\npillar_count = 2.5",
        "kind = 'robot'",
    ],
)
def test_the_schema_refuses_what_the_program_refuses(text: str) -> None:
    """An editor underlines unknown keys, bare numbers, numbers out of range and unknown choices.

    Catches: additional properties allowed, a pattern that accepts anything.
    """
    assert not accepts(json_schema(), tomllib.loads(text))


def test_the_schema_describes_every_key() -> None:
    """Each key's description is there for completion in an editor.

    Catches: descriptions lost on the way.
    """
    schema = json_schema()
    for name in keys():
        part: Any = schema
        for step in name.split("."):
            part = part["properties"][step]
        assert part["description"] == keys()[name].field.description
    assert isinstance(load_design("strip"), Design)
