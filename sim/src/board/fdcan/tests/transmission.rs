use super::*;
use crate::bus::WireError;

#[test]
fn a_dlc_of_zero_is_a_data_frame_unless_rtr_is_set() {
    let mut bench = Bench::running();
    bench.request(0, 0x080, &[]);
    assert_eq!(bench.send(), standard(0x080, &[]));
    assert!(bench.kinds().is_empty());
    // What trap 1 does: RTR set because the length is zero.
    let base = TX_BUFFERS + ELEMENT_WORDS;
    bench.ram(base, 1 << 29 | 0x080 << 18);
    bench.ram(base + 1, 0);
    bench.write(TXBAR, 1 << 1);
    assert_eq!(bench.send(), WireFrame::remote(WireId::Standard(0x080), 0));
    assert_eq!(bench.kinds(), [DiagnosticKind::CanRemoteFrame]);
}

#[test]
fn node_guarding_may_ask_for_remote_frames() {
    let mut bench = Bench::running();
    bench.ram(TX_BUFFERS, 1 << 29 | 0x705 << 18);
    bench.ram(TX_BUFFERS + 1, 1 << 16);
    bench.write(TXBAR, 1);
    assert_eq!(bench.send(), WireFrame::remote(WireId::Standard(0x705), 1));
    assert!(bench.kinds().is_empty());
}

#[test]
fn the_element_is_sent_as_written() {
    let mut bench = Bench::running();
    bench.request(0, 0x605, &[0x23, 0x40, 0x60, 0, 1, 2, 3, 4]);
    assert_eq!(
        bench.send(),
        standard(0x605, &[0x23, 0x40, 0x60, 0, 1, 2, 3, 4])
    );
    bench.ram(TX_BUFFERS + ELEMENT_WORDS, 1 << 30 | 0x1ABC_DEF0);
    bench.ram(TX_BUFFERS + ELEMENT_WORDS + 1, 2 << 16);
    bench.ram(TX_BUFFERS + ELEMENT_WORDS + 2, 0xFFFF_0201);
    bench.write(TXBAR, 1 << 1);
    assert_eq!(bench.send(), WireFrame::extended(0x1ABC_DEF0, &[1, 2]));
}

#[test]
fn a_queue_sends_the_lowest_identifier_first() {
    let mut bench = Bench::running();
    bench.request(0, 0x601, &[1]);
    bench.request(1, 0x201, &[2]);
    bench.request(2, 0x080, &[]);
    assert_eq!(bench.read(TXBRP), 0b111);
    assert_eq!(bench.read(TXFQS) & 1 << 21, 1 << 21, "full");
    let order: Vec<WireFrame> = (0..3).map(|_| bench.send()).collect();
    assert_eq!(
        order,
        [
            standard(0x080, &[]),
            standard(0x201, &[2]),
            standard(0x601, &[1])
        ]
    );
    assert_eq!(bench.read(TXBTO), 0b111);
}

#[test]
fn a_standard_frame_beats_an_extended_one_with_the_same_base() {
    let mut bench = Bench::running();
    bench.ram(TX_BUFFERS, 1 << 30 | 0x080 << 18);
    bench.ram(TX_BUFFERS + 1, 0);
    bench.write(TXBAR, 1);
    bench.request(1, 0x080, &[]);
    assert_eq!(bench.send(), standard(0x080, &[]));
}

#[test]
fn equal_identifiers_go_by_buffer_number_not_by_age() {
    let mut bench = Bench::running();
    bench.request(0, 0x100, &[]);
    bench.request(1, 0x601, &[1]);
    bench.request(2, 0x601, &[2]);
    assert_eq!(
        bench.kinds(),
        [DiagnosticKind::CanTxElement],
        "two equal identifiers pending"
    );
    assert_eq!(bench.send().id, WireId::Standard(0x100));
    // Buffer 0 is free again and is the put index after 2.
    assert_eq!(bench.read(TXFQS) >> 16 & 3, 0);
    bench.request(0, 0x601, &[3]);
    let order: Vec<u8> = (0..3).map(|_| bench.send().data[0]).collect();
    assert_eq!(order, [3, 1, 2], "the youngest overtakes");
}

#[test]
fn a_fifo_sends_in_order_whatever_the_identifiers() {
    let mut bench = Bench::new();
    bench.configure();
    bench.start();
    assert_eq!(bench.read(TXFQS), 3);
    bench.request(0, 0x601, &[]);
    bench.request(1, 0x080, &[]);
    // One free, get 0, put 2.
    assert_eq!(bench.read(TXFQS), 2 << 16 | 1);
    bench.request(2, 0x7FF, &[]);
    assert_eq!(bench.read(TXFQS), 1 << 21);
    bench.write(IE, 0);
    assert_eq!(bench.send().id, WireId::Standard(0x601));
    assert_eq!(bench.read(TXFQS), 1 << 8 | 1);
    assert_eq!(bench.send().id, WireId::Standard(0x080));
    assert_eq!(bench.send().id, WireId::Standard(0x7FF));
    assert_eq!(bench.read(IR), ir::TFE);
}

#[test]
fn writing_another_element_than_the_put_index_is_noted() {
    let mut bench = Bench::running();
    bench.ram(TX_BUFFERS + 2 * ELEMENT_WORDS, 0x100 << 18);
    assert_eq!(bench.kinds(), [DiagnosticKind::CanTxElement]);
    assert!(bench.complaints()[0].1.contains("TFQPI names 0"));
}

#[test]
fn writing_a_pending_element_is_noted() {
    let mut bench = Bench::running();
    bench.request(0, 0x080, &[]);
    bench.ram(TX_BUFFERS, 0x201 << 18);
    assert_eq!(bench.kinds(), [DiagnosticKind::CanTxElement]);
    assert!(bench.complaints()[0].1.contains("pending"));
}

#[test]
fn a_refill_preempted_by_the_sync_shares_its_buffer() {
    // Trap 21: the refill reads the put index, is preempted by the SYNC task,
    // and writes its element into the SYNC's buffer.
    let mut bench = Bench::running();
    let put = (bench.read(TXFQS) >> 16 & 3) as usize;
    bench.request(put, 0x080, &[]);
    bench.request(put, 0x201, &[0; 6]);
    assert!(bench.kinds().contains(&DiagnosticKind::CanTxElement));
    assert_eq!(
        bench.offered().map(|(_, frame)| frame.id),
        Some(WireId::Standard(0x201))
    );
}

#[test]
fn an_offer_waits_for_the_stated_delay() {
    let mut bench = Bench::running();
    bench.now = Time::from_us(100);
    bench.request(0, 0x080, &[]);
    let offer = bench.can.offer(bench.kernel, true).expect("offered");
    assert_eq!(
        offer.ready_at,
        Time::from_ns(100_500),
        "12 periods of 24 MHz"
    );
}

#[test]
fn a_frame_that_lost_arbitration_or_was_destroyed_stays_requested() {
    let mut bench = Bench::running();
    bench.request(0, 0x601, &[]);
    bench.event(EventKind::TxStarted { tag: 0 });
    bench.request(1, 0x080, &[]);
    bench.event(EventKind::ArbitrationLost { tag: 0 });
    assert_eq!(
        bench.offered().map(|(tag, _)| tag),
        Some(1),
        "the queue is looked at anew"
    );
    bench.send();
    bench.event(EventKind::TxStarted { tag: 0 });
    bench.event(EventKind::TxError {
        tag: 0,
        error: WireError::Ack,
    });
    assert_eq!(bench.read(PSR) & 0b111, 3);
    assert_eq!(bench.read(TXBRP), 1);
    assert_eq!(bench.offered().map(|(tag, _)| tag), Some(0));
}

#[test]
fn without_automatic_retransmission_a_destroyed_frame_is_dropped() {
    let mut bench = Bench::new();
    bench.configure();
    bench.write(CCCR, cccr::INIT | cccr::CCE | cccr::DAR);
    bench.start();
    bench.request(0, 0x601, &[]);
    bench.event(EventKind::TxStarted { tag: 0 });
    bench.event(EventKind::ArbitrationLost { tag: 0 });
    assert_eq!(bench.read(TXBRP), 0);
    assert_eq!(bench.read(TXBCF), 1);
    assert_eq!(bench.read(TXBTO), 0);
}

#[test]
fn cancellation_waits_for_a_frame_on_the_wire() {
    let mut bench = Bench::running();
    bench.write(TXBCIE, 0b111);
    bench.request(0, 0x100, &[]);
    bench.request(1, 0x200, &[]);
    bench.event(EventKind::TxStarted { tag: 0 });
    bench.write(TXBCR, 0b11);
    assert_eq!(bench.read(TXBRP), 0b01, "buffer 1 is cancelled at once");
    assert_eq!(bench.read(TXBCF), 0b10);
    assert_eq!(bench.read(IR), ir::TCF);
    let sof = bench.now;
    bench.event(EventKind::TxDone { tag: 0, sof });
    assert_eq!(bench.read(TXBRP), 0);
    assert_eq!((bench.read(TXBTO), bench.read(TXBCF)), (0b01, 0b11));
    assert_eq!(bench.offered(), None);
}

#[test]
fn transmission_completed_only_interrupts_for_enabled_buffers() {
    let mut bench = Bench::running();
    bench.write(TXBTIE, 0b010);
    bench.request(0, 0x100, &[]);
    bench.send();
    assert_eq!(bench.read(IR), 0);
    bench.request(1, 0x100, &[]);
    bench.send();
    assert_eq!(bench.read(IR), ir::TC);
}

#[test]
fn tx_events_carry_marker_and_time() {
    let mut bench = Bench::new();
    bench.configure();
    bench.write(TXBC, TXBC_TFQM);
    bench.write(TSCC, 1);
    bench.start();
    for k in 0..4 {
        let put = (bench.read(TXFQS) >> 16 & 3) as usize;
        let base = TX_BUFFERS + put * ELEMENT_WORDS;
        bench.ram(base, 0x080 << 18);
        bench.ram(base + 1, (0xA0 + k) << 24 | 1 << 23);
        bench.write(TXBAR, 1 << put);
        bench.now = Time::from_us(1000 * u64::from(k + 1));
        bench.send();
    }
    // Three stored, full, get 0, put wrapped; the fourth was lost.
    assert_eq!(bench.read(TXEFS), 1 << 25 | 1 << 24 | 3);
    assert_eq!(bench.read(IR), ir::TEFN | ir::TEFF | ir::TEFL);
    let base = 0x260 / 4;
    assert_eq!(bench.can.ram.word(base), 0x080 << 18);
    assert_eq!(bench.can.ram.word(base + 1), 0xA0 << 24 | 0b01 << 22 | 1000);
    assert_eq!(bench.can.ram.word(base + 3), 0xA1 << 24 | 0b01 << 22 | 2000);
    bench.write(TXEFA, 2);
    assert_eq!(bench.read(TXEFS) & 0xF, 0);
    bench.write(TXEFA, 2);
    assert_eq!(bench.kinds(), [DiagnosticKind::CanRegister]);
}

#[test]
fn monitoring_and_restricted_modes_send_nothing() {
    for mode in [cccr::MON, cccr::ASM] {
        let mut bench = Bench::new();
        bench.configure();
        bench.write(CCCR, cccr::INIT | cccr::CCE | mode);
        bench.start();
        bench.request(0, 0x100, &[]);
        assert!(bench.can.timing(bench.kernel, true).is_some());
        assert_eq!(bench.offered(), None);
    }
}

#[test]
fn a_change_of_the_head_is_marked() {
    let mut bench = Bench::running();
    assert!(bench.can.take_changed());
    assert!(!bench.can.take_changed());
    bench.request(0, 0x601, &[]);
    assert!(bench.can.take_changed());
    bench.receive(standard(1, &[]));
    assert!(!bench.can.take_changed(), "reception offers nothing");
}
