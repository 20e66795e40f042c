from drives import pdo


def test_a_frame_lies_in_memory_as_linux_has_it():
    assert pdo.FRAME.size == pdo.FRAME_BYTES == 16
    assert bytes(pdo.frame(0x123, b"\x01\x02")) == bytes.fromhex("23010000020000000102000000000000")


def test_unpack_gives_back_what_frame_was_given():
    assert pdo.unpack(pdo.frame(0x77F, b"\x05")) == (0x77F, b"\x05")


def test_a_command_frame_starts_as_disable_voltage():
    assert pdo.unpack(pdo.command_frame(3)) == (0x203, bytes(6))


def test_command_and_feedback_hold_six_bytes_each():
    assert pdo.COMMAND.size == pdo.FEEDBACK.size == pdo.PDO_BYTES
    assert pdo.COMMAND.pack(0x0F, -2) == b"\x0f\x00\xfe\xff\xff\xff"
