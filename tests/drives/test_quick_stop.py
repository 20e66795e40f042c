"""Quick stop and NMT stop by hand: what `directrix drives stop` puts on a bus."""

from __future__ import annotations

from support.drives.stepped_drives import Bench

from drives import commission, pdo, quick_stop
from drives.settings import IoSettings


def pump(bench: Bench):  # type: ignore[no-untyped-def]
    return commission.stepped_pump(bench.rig)


def test_drives_that_move_are_stopped_without_a_sync() -> None:
    bench = Bench("XY")
    bench.enable()
    target = 0
    for _ in range(50):
        target += 200
        bench.tick(targets=(target, target))
    silent = quick_stop.stop(bench.service, bench.nodes, pump(bench))
    assert silent == []
    bench.rig.advance(bench.rig.now_s + 1.0)
    places = [round(drive.axis.servo.position) for drive in bench.rig.drives.values()]
    bench.rig.advance(bench.rig.now_s + 0.5)
    assert places == [round(drive.axis.servo.position) for drive in bench.rig.drives.values()]
    assert all(drive.nmt == pdo.NMT_STOPPED for drive in bench.rig.drives.values())


def test_a_drive_that_does_not_answer_is_named_and_the_others_are_stopped() -> None:
    bench = Bench("XY")
    bench.enable()
    absent = [*bench.nodes, bench.nodes[0].__class__("Z", "can", 9, bench.nodes[0].eds)]
    assert quick_stop.stop(bench.service, absent, pump(bench)) == ["Z"]
    bench.rig.advance(bench.rig.now_s + 0.1)
    assert all(drive.nmt == pdo.NMT_STOPPED for drive in bench.rig.drives.values())


def test_inputs_and_outputs_are_stopped_and_asked_for_no_quick_stop() -> None:
    sent: list[tuple[int, bytes]] = []

    class Line:
        overflows = 0

        def send(self, frame: bytes | bytearray | memoryview) -> bool:
            can_id, data = pdo.unpack(frame)
            sent.append((can_id, bytes(data)))
            return True

        def receive_into(self, buffer: bytearray) -> bool:
            return False

    now = iter(range(1000))
    silent = quick_stop.stop(Line(), [IoSettings("io", "can", 7, "")], lambda: float(next(now)))  # type: ignore[arg-type]
    assert silent == []
    assert sent == [(pdo.NMT, bytes((2, 7)))]
