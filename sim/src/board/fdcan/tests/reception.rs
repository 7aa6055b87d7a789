use super::*;

/// A standard filter element.
fn filter(kind: u32, action: u32, id1: u32, id2: u32) -> u32 {
    kind << 30 | action << 27 | id1 << 16 | id2
}

const RANGE: u32 = 0;
const DUAL: u32 = 1;
const MASK: u32 = 2;
const OFF: u32 = 3;
const TO_FIFO0: u32 = 1;
const TO_FIFO1: u32 = 2;
const REJECT: u32 = 3;
const PRIORITY: u32 = 4;
const PRIORITY_FIFO0: u32 = 5;

/// A running controller with these standard filters.
fn filtered(elements: &[u32], gfc: u32) -> Bench {
    let mut bench = Bench::new();
    bench.configure();
    bench.write(RXGFC, gfc | 8 << 24 | (elements.len() as u32) << 16);
    for (k, element) in elements.iter().enumerate() {
        bench.ram(k, *element);
    }
    bench.start();
    bench
}

const REJECT_OTHERS: u32 = 0b10_1000;

/// Which FIFO and filter index an identifier ends in.
fn fate(bench: &mut Bench, id: u16) -> Option<(usize, u32)> {
    bench.receive(standard(id, &[]));
    for (fifo, status, acknowledge) in [(0, RXF0S, RXF0A), (1, RXF1S, RXF1A)] {
        let value = bench.read(status);
        if value & 0xF != 0 {
            let get = (value >> 8 & 3) as usize;
            let word = bench.can.ram.word(RX_FIFO[fifo] + get * ELEMENT_WORDS + 1);
            bench.write(acknowledge, get as u32);
            return Some((fifo, word >> 24));
        }
    }
    None
}

#[test]
fn range_filters_one_per_function_code() {
    let mut bench = filtered(
        &[
            filter(RANGE, TO_FIFO0, 0x181, 0x1FF),
            filter(RANGE, TO_FIFO1, 0x081, 0x0FF),
            filter(RANGE, TO_FIFO1, 0x581, 0x5FF),
        ],
        REJECT_OTHERS,
    );
    assert_eq!(fate(&mut bench, 0x180), None);
    assert_eq!(fate(&mut bench, 0x181), Some((0, 0)));
    assert_eq!(fate(&mut bench, 0x1FF), Some((0, 0)));
    assert_eq!(fate(&mut bench, 0x200), None);
    assert_eq!(fate(&mut bench, 0x0FF), Some((1, 1)));
    assert_eq!(fate(&mut bench, 0x5FF), Some((1, 2)));
    assert!(bench.kinds().is_empty());
}

#[test]
fn dual_mask_disabled_and_reject_filters() {
    let mut bench = filtered(
        &[
            filter(OFF, TO_FIFO0, 0, 0x7FF),
            filter(RANGE, 0, 0, 0x7FF),
            filter(DUAL, TO_FIFO0, 0x123, 0x456),
            filter(RANGE, REJECT, 0x300, 0x3FF),
            filter(MASK, TO_FIFO1, 0x305, 0x70F),
        ],
        REJECT_OTHERS,
    );
    assert_eq!(fate(&mut bench, 0x123), Some((0, 2)));
    assert_eq!(fate(&mut bench, 0x456), Some((0, 2)));
    assert_eq!(fate(&mut bench, 0x124), None);
    assert_eq!(fate(&mut bench, 0x335), None, "the first match decides");
    let mut bench = filtered(&[filter(MASK, TO_FIFO1, 0x305, 0x70F)], REJECT_OTHERS);
    assert_eq!(fate(&mut bench, 0x335), Some((1, 0)));
    assert_eq!(fate(&mut bench, 0x336), None);
}

#[test]
fn frames_that_match_nothing_carry_anmf() {
    let mut bench = filtered(&[], 0b01_0000);
    assert_eq!(fate(&mut bench, 0x7FF), Some((1, 0x80)));
    let mut bench = filtered(&[], 0);
    assert_eq!(fate(&mut bench, 0), Some((0, 0x80)));
}

#[test]
fn the_element_holds_what_was_on_the_wire() {
    let mut bench = filtered(&[filter(RANGE, TO_FIFO0, 0x181, 0x1FF)], 0);
    bench.receive(standard(0x185, &[0x27, 0x06, 0x78, 0x56, 0x34, 0x12]));
    let base = RX_FIFO[0];
    let words: Vec<u32> = (0..4).map(|k| bench.can.ram.word(base + k)).collect();
    assert_eq!(words, [0x185 << 18, 6 << 16, 0x5678_0627, 0x1234]);
    bench.receive(WireFrame::remote(WireId::Extended(0x1234_5678), 3));
    let base = base + ELEMENT_WORDS;
    assert_eq!(bench.can.ram.word(base), 1 << 30 | 1 << 29 | 0x1234_5678);
    assert_eq!(bench.can.ram.word(base + 1), 1 << 31 | 3 << 16);
}

#[test]
fn remote_frames_can_be_rejected() {
    let remote = WireFrame::remote(WireId::Standard(0x701), 0);
    let mut bench = filtered(&[], 0b10);
    bench.receive(remote);
    assert_eq!(bench.read(RXF0S), 0);
    let mut bench = filtered(&[], 0);
    bench.receive(remote);
    assert_eq!(bench.read(RXF0S) & 0xF, 1);
}

#[test]
fn extended_filters_mask_with_xidam_unless_told_otherwise() {
    let mut bench = Bench::new();
    bench.configure();
    bench.write(XIDAM, 0x1FFF_FF00);
    bench.write(RXGFC, 2 << 24 | REJECT_OTHERS);
    let base = 0x070 / 4;
    // Range with XIDAM to FIFO 0, range without it to FIFO 1.
    for (k, word) in [
        TO_FIFO0 << 29 | 0x1000,
        0x1000,
        TO_FIFO1 << 29 | 0x2010,
        OFF << 30 | 0x2020,
    ]
    .into_iter()
    .enumerate()
    {
        bench.ram(base + k, word);
    }
    bench.start();
    for (id, levels) in [
        (0x10FF, [1, 0]),
        (0x1100, [0, 0]),
        (0x2010, [0, 1]),
        (0x2021, [0, 0]),
    ] {
        bench.receive(WireFrame::extended(id, &[]));
        let got = [bench.read(RXF0S) & 0xF, bench.read(RXF1S) & 0xF];
        assert_eq!(got, levels, "identifier 0x{id:x}");
        for (fifo, register) in [(0, RXF0A), (1, RXF1A)] {
            if got[fifo] == 1 {
                let get = bench.read([RXF0S, RXF1S][fifo]) >> 8 & 3;
                bench.write(register, get);
            }
        }
    }
}

#[test]
fn a_full_fifo_loses_the_newest_frame_and_says_so() {
    let mut bench = filtered(&[filter(RANGE, TO_FIFO0, 0x181, 0x1FF)], REJECT_OTHERS);
    for id in 0x181..=0x184 {
        bench.receive(standard(id, &[]));
    }
    // Three stored, full, get 0, put wrapped to 0, one lost.
    assert_eq!(bench.read(RXF0S), 1 << 25 | 1 << 24 | 3);
    assert_eq!(bench.read(IR), ir::RF0N | ir::RF0F | ir::RF0L);
    assert_eq!(bench.can.ram.word(RX_FIFO[0]) >> 18, 0x181);
    assert_eq!(bench.can.lost(), 1);
    assert_eq!(bench.kinds(), [DiagnosticKind::CanOverrun]);
    // Reading does not clear the mark, the flag does.
    bench.write(RXF0A, 0);
    assert_eq!(bench.read(RXF0S), 1 << 25 | 1 << 8 | 2);
    bench.write(IR, ir::RF0L);
    assert_eq!(bench.read(RXF0S), 1 << 8 | 2);
}

#[test]
fn overwrite_mode_loses_the_oldest() {
    let mut bench = filtered(&[], 1 << 9);
    for id in 1..=5 {
        bench.receive(standard(id, &[]));
    }
    assert_eq!(bench.read(RXF0S), 1 << 24 | 2 << 16 | 2 << 8 | 3);
    let get = (bench.read(RXF0S) >> 8 & 3) as usize;
    assert_eq!(
        bench.can.ram.word(RX_FIFO[0] + get * ELEMENT_WORDS) >> 18,
        3
    );
    assert_eq!(bench.read(IR) & ir::RF0L, 0, "overwriting is not a loss");
}

#[test]
fn acknowledging_the_last_read_frees_all_before_it() {
    let mut bench = filtered(&[], 0);
    for id in 1..=3 {
        bench.receive(standard(id, &[]));
    }
    bench.write(RXF0A, 1);
    assert_eq!(bench.read(RXF0S), 2 << 8 | 1);
    bench.write(RXF0A, 0);
    assert_eq!(
        bench.kinds(),
        [DiagnosticKind::CanRegister],
        "element 0 is free already"
    );
    assert_eq!(bench.read(RXF0S), 2 << 8 | 1);
}

#[test]
fn priority_filters_tell_hpms() {
    let mut bench = filtered(
        &[
            filter(DUAL, PRIORITY, 0x080, 0x080),
            filter(DUAL, PRIORITY_FIFO0, 0x181, 0x181),
        ],
        REJECT_OTHERS,
    );
    bench.receive(standard(0x080, &[]));
    assert_eq!(bench.read(IR), ir::HPM);
    assert_eq!(bench.read(HPMS), 0, "filter 0, not stored");
    bench.receive(standard(0x181, &[]));
    assert_eq!(bench.read(IR), ir::HPM | ir::RF0N);
    assert_eq!(bench.read(HPMS), 1 << 8 | 0b10 << 6);
    assert_eq!(bench.read(RXF0S) & 0xF, 1);
}

#[test]
fn frames_carry_the_time_of_their_start() {
    let mut bench = Bench::new();
    bench.configure();
    bench.write(RXGFC, 0);
    bench.write(TSCC, 1);
    bench.start();
    bench.now = Time::from_us(1234);
    let sof = Time::from_us(1000);
    bench.event(EventKind::Rx {
        frame: standard(0x181, &[]),
        sof,
    });
    assert_eq!(bench.can.ram.word(RX_FIFO[0] + 1) & 0xFFFF, 1000);
}

#[test]
fn nothing_is_received_in_init() {
    let mut bench = filtered(&[], 0);
    bench.write(CCCR, cccr::INIT);
    bench.receive(standard(1, &[]));
    assert_eq!(bench.read(RXF0S), 0);
}
