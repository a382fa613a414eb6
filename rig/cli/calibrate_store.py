"""`rig calibrate add | list | show | diff | use | diagnose`: the store of calibrations."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from estimation.files import write_text_atomic
from rig.cli.options import LedgerOption, SeedOption
from rig.errors import UsageError
from rig.output.console import JsonFlag, present, stages
from rig.output.provenance import now_utc

if TYPE_CHECKING:
    from calibration.record import CalibrationRecord
    from calibration.store import CalibrationStore
    from rig.configuration.config import Config

StoreOption = Annotated[
    Path | None,
    Option(
        "--store",
        help="Folder; if none, RIG_CALIBRATIONS, else ~/.config/rig/calibrations; what is not"
        " there is searched in NAME-simulated, the folder of the simulated rig.",
    ),
]
Hash = Annotated[str, Argument(help="Hash of a record, or its beginning.")]


def add(
    file: Annotated[Path, Argument(help="TOML with a table [channels.NAME] per channel.")],
    operator: Annotated[str, Option(help="Person responsible for the numbers.")],
    kind: Annotated[str, Option(help="Origin of the numbers.")] = "certificate",
    made_at: Annotated[
        str | None, Option(help="Date, ISO 8601 with offset from UTC; by default now.")
    ] = None,
    days: Annotated[float | None, Option(help="Stale after this many days.")] = None,
    serial: Annotated[
        list[str] | None, Option(help="DEVICE=SERIAL of the record; may be repeated.")
    ] = None,
    instrument: Annotated[
        str, Option(help="Serial number of the instrument, if valid for one only.")
    ] = "",
    channel: Annotated[list[str] | None, Option(help="Only these channels.")] = None,
    store: StoreOption = None,
    json: JsonFlag = False,
) -> None:
    """Store the lines of a certificate's TOML file, one record per channel. Makes none active."""
    from calibration.linear import load_calibration_set
    from calibration.record import RawFile, Validity, record_of_line
    from rig import __version__

    lines = load_calibration_set(file).channels
    wanted = channel or sorted(lines)
    if unknown := sorted(set(wanted) - set(lines)):
        raise UsageError(f"{file} has no channel {unknown[0]!r}.", f"It has {', '.join(lines)}.")
    made = [
        record_of_line(
            lines[name],
            kind=kind,
            made_at=made_at or now_utc(),
            operator=operator,
            instrument=instrument,
            serials=_serials(serial or []),
            validity=Validity(days=days),
            raw=(RawFile.of(file),),
            code_version=__version__,
        )
        for name in wanted
    ]
    kept = store_of(store)
    hashes = {record.channel: kept.add(record) for record in made}
    data = {"store": kept.folder, "added": hashes}
    present(json, data, *(f"{digest}  {name}" for name, digest in hashes.items()))


def list_(store: StoreOption = None, json: JsonFlag = False) -> None:
    """List every record, oldest first; the active ones are marked."""
    from rig.calibrate.shown import main_parameter

    said = []
    listed: list[dict[str, Any]] = []
    for kept in _stores(store):
        active = {record.content_hash for record in kept.active().values()}
        records = kept.records()
        said += [f"Store {kept.folder}"] if records else []
        for r in records:  # lines, not a table: a terminal would cut the hashes off
            is_active = r.content_hash in active
            whom = f", instrument {r.instrument}" if r.instrument else ""
            made = f"{r.kind}, {r.made:%Y-%m-%d %H:%M} by {r.operator}{whom}"
            mark = "*" if is_active else " "
            said.append(f"{mark} {r.content_hash}  {r.channel}  {made}: {main_parameter(r)}")
            listed.append(
                {
                    "hash": r.content_hash,
                    "kind": r.kind,
                    "channel": r.channel,
                    "instrument": r.instrument,
                    "made_at": r.made_at,
                    "operator": r.operator,
                    "parameters": r.fit.parameters,
                    "active": is_active,
                    "store": kept.folder,
                }
            )
    none = "No records yet. `rig calibrate torque` makes one, `add` takes a certificate."
    kept = store_of(store)
    data = {"store": kept.folder, "records": listed, "choices": kept.choices()}
    present(json, data, *said, "* active" if listed else none)


def show(
    record: Hash,
    figure: Annotated[Path | None, Option(help="Write the residual figure here.")] = None,
    store: StoreOption = None,
    json: JsonFlag = False,
) -> None:
    """Show one record completely."""
    found = _holding(record, store).get(record)
    said = [f"{name}: {value}" for name, value in _in_words(found).items()]
    if figure is not None:
        if not found.figure_svg:
            raise UsageError(f"The record {found.content_hash} has no figure.")
        write_text_atomic(figure, found.figure_svg)
        said.append(f"Figure: {figure}")
    present(json, {"hash": found.content_hash, "record": found}, *said)


def diff(first: Hash, second: Hash, store: StoreOption = None, json: JsonFlag = False) -> None:
    """Show what differs between two records."""
    a, b = (_holding(start, store).get(start) for start in (first, second))
    left, right = _flat(a), _flat(b)
    changes = {
        name: {"first": left.get(name), "second": right.get(name)}
        for name in sorted({*left, *right})
        if left.get(name) != right.get(name)
    }
    before, after = _in_words(a), _in_words(b)
    said = [
        f"{name}: {before.get(name)} -> {after.get(name)}"
        for name in dict.fromkeys((*before, *after))
        if before.get(name) != after.get(name)
    ]
    if not changes:
        said.append("The two are the same record.")
    present(json, {"first": a.content_hash, "second": b.content_hash, "changes": changes}, *said)


def use(
    record: Hash,
    by: Annotated[str, Option(help="Name of the person who chooses it.")],
    store: StoreOption = None,
    json: JsonFlag = False,
) -> None:
    """Make a record the active one of its kind, channel and instrument."""
    kept = _holding(record, store)
    before = kept.active()
    chosen = kept.use(record, now_utc(), by)
    old = before.get(chosen.key)
    was = old.content_hash if old else None
    data = {"record": chosen.content_hash, "replaced": was, "key": chosen.key}
    present(json, data, f"{chosen.channel}: {chosen.content_hash} in place of {was or 'none'}.")


def diagnose(
    record: Hash,
    seed: SeedOption = 0,
    store: StoreOption = None,
    ledger: LedgerOption = None,
    json: JsonFlag = False,
) -> None:
    """Run the diagnosis on the raw logs of a calibration."""
    from rig.calibrate.declared import declared_by_record
    from rig.diagnosis.ledger import Ledger, default_ledger
    from rig.diagnosis.run import run_diagnosis
    from rig.diagnosis.subject import of_calibration
    from rig.reports.diagnosis_words import lines

    asked = of_calibration(declared_by_record(_holding(record, store).get(record)))
    looks = Ledger(ledger or default_ledger())
    with stages() as on_stage:
        done, look = run_diagnosis(asked, looks, seed=seed, on_stage=on_stage)
    looks.enter(look)
    data = done.diagnosis.to_json() if json else None
    present(json, data, *lines(done.diagnosis))


def store_of(folder: Path | None, settings: "Config | None" = None) -> "CalibrationStore":
    """Return the store in a folder; without one that of a rig, else the default."""
    from calibration.store import CalibrationStore, default_folder

    if folder is None and settings is not None:
        return settings.store or settings.default_store
    return CalibrationStore(folder or default_folder())


def _stores(folder: Path | None) -> "list[CalibrationStore]":
    """Return the named store; with none the real rig's and the simulated rig's."""
    from calibration.store import CalibrationStore, simulated_folder

    kept = store_of(folder)
    return [kept] if folder else [kept, CalibrationStore(simulated_folder(kept.folder))]


def _holding(start: str, folder: Path | None) -> "CalibrationStore":
    """Return the store that has a record of this hash; the first one where none has."""
    stores = _stores(folder)
    holds = (s for s in stores if any(r.content_hash.startswith(start) for r in s.records()))
    return next(holds, stores[0])


def _serials(words: list[str]) -> dict[str, str]:
    pairs = dict(word.split("=", 1) for word in words if "=" in word)
    if len(pairs) != len(words) or not all(k and v for k, v in pairs.items()):
        raise UsageError("A serial number is given as DEVICE=SERIAL.", f"Given: {words}.")
    return pairs


def _in_words(record: "CalibrationRecord") -> dict[str, Any]:
    """Return a record for people: parameters with unit and spread, in place of a covariance."""
    from rig.calibrate.shown import parameter_texts

    known = {k: v for k, v in _flat(record).items() if not k.startswith("fit.")}
    fit = {"form": record.fit.form, "residual rms": record.fit.residual_rms}
    return known | parameter_texts(record) | fit


def _flat(record: "CalibrationRecord") -> dict[str, Any]:
    """Return a record as dotted names and values; a hash of the figure, a line of the raw logs."""
    from hashlib import sha256

    from rig.output.console import plain

    flat: dict[str, Any] = {"hash": record.content_hash}

    def walk(prefix: str, value: Any) -> None:
        if isinstance(value, dict):
            for name, item in value.items():
                walk(f"{prefix}.{name}" if prefix else name, item)
        elif prefix == "figure_svg":
            flat[prefix] = sha256(value.encode()).hexdigest()[:16] if value else ""
        elif prefix == "raw" and value:
            flat[prefix] = f"{len(value)} logs from {value[0]['path']}"
        else:
            flat[prefix] = value

    walk("", plain(record))
    return flat
