use super::*;
use crate::bus::{ErrorState, WireError};

#[test]
fn reset_values_are_those_of_the_reference_manual() {
    let mut bench = Bench::new();
    for (offset, value) in [
        (CREL, 0x3214_1218),
        (ENDN, 0x8765_4321),
        (DBTP, 0x0000_0A33),
        (TEST, 0x0000_0080),
        (RWD, 0),
        (CCCR, 1),
        (NBTP, 0x0600_0A03),
        (TSCC, 0),
        (TSCV, 0),
        (TOCC, 0xFFFF_0000),
        (TOCV, 0x0000_FFFF),
        (ECR, 0),
        (PSR, 0x0000_0707),
        (TDCR, 0),
        (IR, 0),
        (IE, 0),
        (ILS, 0),
        (ILE, 0),
        (RXGFC, 0),
        (XIDAM, 0x1FFF_FFFF),
        (HPMS, 0),
        (RXF0S, 0),
        (RXF1S, 0),
        (TXBC, 0),
        (TXFQS, 3),
        (TXBRP, 0),
        (TXEFS, 0),
        (CKDIV, 0),
    ] {
        assert_eq!(bench.read(offset), value, "register 0x{offset:03x}");
    }
    for offset in [0x008, 0x030, 0x08C, 0x0F0, 0x104] {
        assert_eq!(bench.with_env(|can, env| can.read(offset, env)), None);
    }
    let mut second = Fdcan::new(2);
    let read = bench.with_env(|_, env| second.read(CKDIV, env));
    assert_eq!(read, None, "CKDIV is FDCAN1's");
}

#[test]
fn clock_stop_is_acknowledged() {
    let mut bench = Bench::new();
    bench.write(CCCR, cccr::INIT | cccr::CSR);
    assert_eq!(bench.read(CCCR), cccr::INIT | cccr::CSR | cccr::CSA);
    bench.write(CCCR, cccr::INIT);
    assert_eq!(bench.read(CCCR), cccr::INIT);
}

#[test]
fn protected_registers_need_init_and_cce() {
    let mut bench = Bench::new();
    bench.write(NBTP, NBTP_1M);
    assert_eq!(bench.read(NBTP), NBTP_RESET);
    assert_eq!(bench.kinds(), [DiagnosticKind::CanRegister]);
    bench.write(CCCR, cccr::INIT | cccr::CCE);
    bench.write(NBTP, NBTP_1M);
    assert_eq!(bench.read(NBTP), NBTP_1M);
    // DAR needs CCE, too; CCE falls with INIT.
    bench.write(CCCR, cccr::INIT | cccr::CCE | cccr::DAR);
    bench.write(CCCR, cccr::CCE | cccr::DAR);
    assert_eq!(bench.read(CCCR), cccr::DAR);
    bench.write(CCCR, 0);
    assert_eq!(bench.read(CCCR), cccr::DAR);
}

#[test]
fn the_bit_timing_follows_clock_and_nbtp() {
    let mut bench = Bench::new();
    assert_eq!(bench.can.timing(bench.kernel, true), None, "INIT");
    bench.configure();
    bench.start();
    let timing = bench.can.timing(bench.kernel, true).expect("on the bus");
    assert_eq!(timing.bit_time_ps, 1_000_000);
    assert_eq!(timing.sample_point_permille, 875);
    assert_eq!(timing.sjw_permille, SJW_PERMILLE);
    let fast = bench.kernel.map(|clock| clock.with_error_ppb(100_000));
    let timing = bench.can.timing(fast, true).expect("on the bus");
    assert_eq!(timing.bit_time_ps, 999_900);
    assert_eq!(bench.can.timing(None, true), None, "no clock");
    assert_eq!(bench.can.timing(bench.kernel, false), None, "no pins");
}

#[test]
fn other_prescalers_of_the_reference() {
    for (hz, prescaler, segment1, segment2, sample) in [
        (80_000_000, 5, 13, 2, 875),
        (160_000_000, 10, 13, 2, 875),
        (170_000_000, 10, 14, 2, 882),
        (170_000_000, 5, 29, 4, 882),
    ] {
        let mut bench = Bench::new();
        bench.write(CCCR, cccr::INIT | cccr::CCE);
        bench.write(
            NBTP,
            (prescaler - 1) << 16 | (segment1 - 1) << 8 | (segment2 - 1),
        );
        bench.start();
        let timing = bench
            .can
            .timing(Some(Frequency::from_hz(hz)), true)
            .expect("on the bus");
        assert_eq!(timing.bit_time_ps, 1_000_000);
        assert_eq!(timing.sample_point_permille, sample);
    }
}

#[test]
fn joining_without_clock_or_pins_is_noted() {
    let mut bench = Bench::new();
    bench.kernel = None;
    bench.pins = false;
    bench.configure();
    bench.start();
    assert_eq!(
        bench.kinds(),
        [DiagnosticKind::Clocks, DiagnosticKind::CanPins]
    );
}

#[test]
fn loop_back_is_noted_and_stays_off_the_bus() {
    let mut bench = Bench::new();
    bench.write(CCCR, cccr::INIT | cccr::CCE);
    bench.write(CCCR, cccr::INIT | cccr::CCE | cccr::TEST);
    bench.write(TEST, TEST_LBCK);
    bench.start();
    assert_eq!(bench.can.timing(bench.kernel, true), None);
    assert_eq!(bench.kinds(), [DiagnosticKind::CanRegister]);
}

#[test]
fn groups_route_flags_to_lines() {
    let mut bench = Bench::running();
    bench.write(IE, ir::TC | ir::RF0N | ir::BO);
    bench.write(ILE, 0b01);
    bench.write(TXBTIE, 0b111);
    bench.request(0, 0x100, &[]);
    bench.send();
    assert_eq!(bench.can.lines(), [true, false]);
    // SMSG to line 1, which is not enabled yet.
    bench.write(ILS, 1 << 2);
    assert_eq!(bench.can.lines(), [false, false]);
    assert!(bench.kinds().is_empty());
    bench.write(ILE, 0b11);
    assert_eq!(bench.can.lines(), [false, true]);
    bench.write(IR, ir::TC);
    assert_eq!(bench.can.lines(), [false, false]);
}

#[test]
fn an_enabled_flag_on_a_dead_line_is_noted() {
    let mut bench = Bench::running();
    bench.write(IE, ir::RF0N);
    bench.write(ILE, 0b10);
    bench.write(CCCR, cccr::INIT);
    bench.write(CCCR, cccr::INIT | cccr::CCE);
    bench.write(RXGFC, 0);
    bench.start();
    bench.receive(standard(0x181, &[1]));
    assert_eq!(bench.can.lines(), [false, false]);
    assert_eq!(bench.kinds(), [DiagnosticKind::InterruptRouting]);
    assert!(bench.complaints()[0].1.contains("RF0N"));
}

#[test]
fn error_counters_and_states_show_in_ecr_and_psr() {
    let mut bench = Bench::running();
    let counters = |tec, rec, state| EventKind::Counters { tec, rec, state };
    bench.event(EventKind::RxError {
        error: WireError::Crc,
    });
    bench.event(counters(0, 1, ErrorState::Active));
    assert_eq!(bench.read(PSR) & 0b111, 6);
    assert_eq!(bench.read(PSR) & 0b111, 7, "reading sets it to no change");
    assert_eq!(bench.read(ECR), 1 << 16 | 1 << 8);
    assert_eq!(bench.read(ECR), 1 << 8, "CEL is cleared by reading");
    bench.event(counters(96, 1, ErrorState::Warning));
    assert_eq!(bench.read(PSR) & 0xE0, 0x40);
    bench.event(counters(128, 130, ErrorState::Passive));
    assert_eq!(bench.read(PSR) & 0xE0, 0x60);
    assert_eq!(
        bench.read(ECR) & 0xFFFF,
        0xFF80,
        "REC above 127 shows as RP"
    );
    assert_eq!(bench.read(IR), ir::EW | ir::EP | ir::PEA);
}

#[test]
fn bus_off_sets_init_and_software_brings_it_back() {
    let mut bench = Bench::running();
    bench.request(0, 0x100, &[1]);
    bench.event(EventKind::TxStarted { tag: 0 });
    bench.event(EventKind::TxError {
        tag: 0,
        error: WireError::Bit0,
    });
    bench.event(EventKind::Counters {
        tec: 256,
        rec: 0,
        state: ErrorState::BusOff,
    });
    assert_eq!(bench.read(CCCR) & cccr::INIT, cccr::INIT);
    assert_eq!(bench.read(PSR) & 0xE7, 0xE5);
    assert_eq!(bench.read(ECR) & 0xFF, 0xFF);
    assert_ne!(bench.read(IR) & ir::BO, 0);
    assert_eq!(bench.can.timing(bench.kernel, true), None);
    assert_eq!(bench.offered(), None);
    bench.write(IR, ir::ALL);
    bench.write(CCCR, 0);
    assert!(
        bench.can.timing(bench.kernel, true).is_some(),
        "recovery may begin"
    );
    bench.event(EventKind::Counters {
        tec: 0,
        rec: 0,
        state: ErrorState::Active,
    });
    assert_eq!(bench.read(PSR) & 0xE0, 0);
    assert_eq!(
        bench.read(IR) & ir::BO,
        ir::BO,
        "a change of the bus-off state"
    );
    assert!(bench.offered().is_some(), "the request is still pending");
}

#[test]
fn the_internal_timestamp_counts_bits_and_wraps() {
    let mut bench = Bench::new();
    bench.configure();
    // Internal, four bits per tick.
    bench.write(TSCC, 3 << 16 | 1);
    bench.start();
    bench.write(IE, ir::TSW);
    bench.write(ILE, 1);
    bench.now = Time::from_us(4_000);
    assert_eq!(bench.read(TSCV), 1000);
    let wrap = bench.can.next_wrap(bench.kernel).expect("enabled");
    assert_eq!(wrap, Time::from_us(4 * 65_536));
    bench.now = wrap;
    bench.with_env(|can, env| can.tick(env));
    assert_eq!(bench.read(IR), ir::TSW);
    assert_eq!(bench.read(TSCV), 0);
    bench.now = Time::from_us(300_000);
    bench.write(TSCV, 0);
    assert_eq!(bench.read(TSCV), 0, "a write restarts it");
}

#[test]
fn the_external_timestamp_is_tim3() {
    let mut bench = Bench::new();
    bench.configure();
    bench.write(TSCC, 2);
    bench.start();
    assert_eq!(bench.read(TSCV), 4711);
}

#[test]
fn setting_cce_empties_fifos_and_requests() {
    let mut bench = Bench::running();
    bench.request(0, 0x100, &[]);
    bench.write(CCCR, cccr::INIT);
    assert_eq!(bench.read(TXBRP), 1);
    bench.write(CCCR, cccr::INIT | cccr::CCE);
    assert_eq!(bench.read(TXBRP), 0);
    assert_eq!(bench.read(TXFQS), 0, "queue mode: no free level");
    bench.write(TXBAR, 1);
    assert_eq!(bench.read(TXBRP), 0);
    assert_eq!(bench.kinds(), [DiagnosticKind::CanTxElement]);
}

#[test]
fn a_reset_keeps_the_message_ram() {
    let mut bench = Bench::running();
    bench.can.ram.set_word(5, 99);
    bench.can.reset();
    assert_eq!(bench.can.ram.word(5), 99);
    assert_eq!(bench.read(CCCR), 1);
}
