use proptest::prelude::*;

use crate::bridge::slcan::{Command, received};
use crate::frame::{WireFrame, WireId};

fn parse(line: &str) -> Option<Command> {
    Command::parse(line.as_bytes())
}

fn sends(line: &str) -> WireFrame {
    match parse(line) {
        Some(Command::Send(frame)) => frame,
        other => panic!("{line}: {other:?}"),
    }
}

#[test]
fn frames_as_the_manual_writes_them() {
    assert_eq!(
        sends("t10021133"),
        WireFrame::standard(0x100, &[0x11, 0x33])
    );
    assert_eq!(sends("t0800"), WireFrame::standard(0x080, &[]));
    assert_eq!(
        sends("T0000010021133"),
        WireFrame::extended(0x100, &[0x11, 0x33])
    );
    assert_eq!(
        sends("r1002"),
        WireFrame::remote(WireId::Standard(0x100), 2)
    );
    assert_eq!(
        sends("R000001002"),
        WireFrame::remote(WireId::Extended(0x100), 2)
    );
    assert_eq!(sends("t7ff1aB"), WireFrame::standard(0x7FF, &[0xAB]));
}

#[test]
fn settings() {
    assert_eq!(parse("S0"), Some(Command::BitRate(10_000)));
    assert_eq!(parse("S7"), Some(Command::BitRate(800_000)));
    assert_eq!(parse("S8"), Some(Command::BitRate(1_000_000)));
    assert_eq!(parse("O"), Some(Command::Open));
    assert_eq!(parse("C"), Some(Command::Close));
    assert_eq!(parse("F"), Some(Command::Flags));
    assert_eq!(parse("V"), Some(Command::Version));
    assert_eq!(parse("N"), Some(Command::Serial));
    assert_eq!(parse("Z1"), Some(Command::Stamps(true)));
    assert_eq!(parse(""), Some(Command::Nothing));
}

#[test]
fn what_is_not_of_the_protocol_is_nothing() {
    for line in [
        "S9",
        "S",
        "S88",
        "s0014",
        "L",
        "O1",
        "c",
        "Z2",
        "Z",
        "x",
        "t",
        "t1",
        "t100",
        "t8000",
        "t1009112233445566778899",
        "t1002113",
        "t100211",
        "t10021133A",
        "t1002g133",
        "t-100",
        "r10021133",
        "r1009",
        "T200000000",
        "T1FFFFFFF",
        "t10\u{e9}21133",
    ] {
        assert_eq!(parse(line), None, "{line}");
    }
}

#[test]
fn frames_received_are_told_alike() {
    let sync = WireFrame::standard(0x080, &[]);
    assert_eq!(received(&sync, None), "t0800\r");
    assert_eq!(received(&sync, Some(60_255)), "t080000FF\r");
    let remote = WireFrame::remote(WireId::Extended(0x123), 3);
    assert_eq!(received(&remote, None), "R000001233\r");
}

fn any_frame() -> impl Strategy<Value = WireFrame> {
    let data = prop::collection::vec(any::<u8>(), 0..=8);
    prop_oneof![
        (0..=0x7FFu16, data.clone()).prop_map(|(id, data)| WireFrame::standard(id, &data)),
        (0..=0x1FFF_FFFFu32, data).prop_map(|(id, data)| WireFrame::extended(id, &data)),
        (0..=0x7FFu16, 0..=8u8).prop_map(|(id, n)| WireFrame::remote(WireId::Standard(id), n)),
    ]
}

proptest! {
    #[test]
    fn what_is_told_can_be_sent(frame in any_frame()) {
        let line = received(&frame, None);
        prop_assert_eq!(parse(line.trim_end()), Some(Command::Send(frame)));
    }

    #[test]
    fn any_bytes_do(line in prop::collection::vec(any::<u8>(), 0..40)) {
        Command::parse(&line);
    }
}
