use super::super::{DiagnosticKind, irqs};
use super::*;
use crate::bus::{BitTiming, Bus, Event, RecordKind, WireRecord};
use crate::frame::WireFrame;

pub(super) const CAN1: u32 = 0x4000_6400;
pub(super) const CAN1_TX: u32 = 0x4000_A400 + 0x278;

/// FDCAN1 on PCLK1 = HSI 16 MHz at 1 Mbit/s (1 + 13 + 2 quanta), PA11/PA12.
pub(super) fn can_program() -> Program {
    Program::default()
        .store(RCC_APB1ENR1, 1 << 25)
        .store(RCC_AHB2ENR, 1)
        .store(0x4002_1088, 0b10 << 24)
        .store(GPIOA, 0xABFF_FFFF & !(0b0101 << 22))
        .store(GPIOA + 0x24, 9 << 12 | 9 << 16)
        .store(CAN1 + 0x18, 0b11)
        .store(CAN1 + 0x1C, 12 << 8 | 1)
        .store(CAN1 + 0xC0, 1 << 24)
        .store(CAN1 + 0x54, 1)
        .store(CAN1 + 0x5C, 1)
        .store(NVIC_ISER0, 1 << 21)
        .store(CAN1 + 0x18, 0)
}

/// Sends a SYNC at every update of TIM2, each millisecond, into buffer 0.
fn sync_program(program: Program) -> Program {
    let mut handler = store(TIM2 + TIM_SR, 0);
    handler.extend(store(CAN1 + 0xCC, 1));
    program
        .store(CAN1_TX, 0x080 << 18)
        .store(CAN1_TX + 4, 0)
        .store(RCC_APB1ENR1, 1 << 25 | 1)
        .store(TIM2 + TIM_ARR, 15_999)
        .store(TIM2 + TIM_DIER, 1)
        .store(NVIC_ISER0, 1 << 28)
        .store(TIM2 + TIM_CR1, 1)
        .sleeps()
        .handler(TIM2_EXCEPTION, handler)
}

/// Runs a board on a bus with one other node at 1 Mbit/s, +50 ppm.
fn on_a_bus(board: &mut Board, until: Time) -> Vec<WireRecord> {
    let mut bus = Bus::new(1);
    let port = bus.attach("board");
    let peer = bus.attach("peer");
    bus.set_timing(peer, Some(BitTiming::new(1_000_000, 50.0)), Time::ZERO);
    let mut events: Vec<Event> = Vec::new();
    while board.now() < until {
        let t = bus.next_event().map_or(until, |t| t.min(until));
        match board.run_until(t) {
            Stop::CanChanged => {
                bus.set_timing(port, board.can_timing(0), board.now());
                bus.offer(port, board.can_offer(0));
            }
            Stop::Reached => {
                bus.advance(t, &mut events);
                for event in events.drain(..).filter(|event| event.port == port) {
                    board.can_event(0, &event);
                }
            }
            Stop::Fault(report) => panic!("{report}"),
        }
    }
    bus.take_records()
}

fn syncs(records: &[WireRecord]) -> Vec<Time> {
    let sync = RecordKind::Frame(WireFrame::standard(0x080, &[]));
    records
        .iter()
        .filter(|record| record.kind == sync)
        .map(|record| record.sof)
        .collect()
}

#[test]
fn a_sync_leaves_at_every_update() {
    let mut board = sync_program(can_program()).board();
    let sent = syncs(&on_a_bus(&mut board, Time::from_us(20_500)));
    assert_eq!(sent.len(), 20);
    for pair in sent.windows(2) {
        // The timer is exact; the start waits for the bit boundary.
        let period = pair[1].since(pair[0]).as_us_f64();
        assert!((period - 1000.0).abs() < 1.1, "{period}");
    }
    let stats = board.stats();
    assert_eq!(stats.sync.count, 20);
    // Entry, two stores to get there, the second of which requests.
    let cycles = stats.sync.worst_first_cycles;
    assert!((12 + 12..12 + 20).contains(&cycles), "{cycles}");
    assert_eq!(stats.sync.worst_last_cycles, cycles);
    // The program always takes buffer 0, but the put index moves on.
    let kinds: Vec<_> = board.diagnostics().iter().map(|entry| entry.kind).collect();
    assert_eq!(kinds, [DiagnosticKind::CanTxElement]);
}

#[test]
fn delaying_the_sync_task_shows_on_the_wire() {
    let mut board = sync_program(can_program()).board();
    // Up to 500 us of 16 MHz cycles.
    board.delay_irq(irqs::TIM2, 8_000, 3);
    let sent = syncs(&on_a_bus(&mut board, Time::from_us(40_500)));
    let offsets: Vec<f64> = sent
        .iter()
        .enumerate()
        .map(|(k, sof)| sof.as_us_f64() - 1000.0 * k as f64)
        .collect();
    let (low, high) = offsets
        .iter()
        .fold((f64::MAX, f64::MIN), |(low, high), &x| {
            (low.min(x), high.max(x))
        });
    assert!((300.0..502.0).contains(&(high - low)), "{}", high - low);
}

#[test]
fn a_wrong_bit_rate_makes_error_frames() {
    // 1 + 11 + 2 quanta of 16 MHz: 1.14 Mbit/s.
    let program = can_program()
        .store(CAN1 + 0x18, 1)
        .store(CAN1 + 0x18, 0b11)
        .store(CAN1 + 0x1C, 10 << 8 | 1)
        .store(CAN1 + 0x18, 0);
    let mut board = sync_program(program).board();
    let records = on_a_bus(&mut board, Time::from_ms(5));
    assert!(syncs(&records).is_empty());
    assert!(
        records
            .iter()
            .any(|record| matches!(record.kind, RecordKind::ErrorFrame { .. }))
    );
}
