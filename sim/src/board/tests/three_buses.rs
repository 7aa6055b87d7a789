//! FDCAN1, 2 and 3 on a bus each, driven from one tick.

use super::*;
use crate::bus::{BitTiming, Bus, Event, RecordKind};
use crate::frame::WireFrame;

const CAN: [u32; 3] = [0x4000_6400, 0x4000_6800, 0x4000_6C00];
const RAM: [u32; 3] = [0x4000_A400, 0x4000_A750, 0x4000_AAA0];
const TX_EVENTS: u32 = 0x260;
const TX_BUFFERS: u32 = 0x278;
const TXBAR: u32 = 0x0CC;
const IR: u32 = 0x050;
const TEFN: u32 = 1 << 10;
/// FDCAN2_IT0 and FDCAN3_IT0.
const IT0: [usize; 2] = [86, 88];
const NVIC_ISER2: u32 = NVIC_ISER0 + 8;
const FIRST_IRQ: usize = 16;
/// Where the program counts the interrupts, and keeps the first and the last
/// timestamp, of FDCAN2 and FDCAN3.
const COUNTS: [u32; 2] = [SRAM, SRAM + 4];
const FIRST: [u32; 2] = [SRAM + 8, SRAM + 12];
const LAST: [u32; 2] = [SRAM + 16, SRAM + 20];
const TICKS: u64 = 3;

/// All three on PCLK1 = HSI 16 MHz at 1 Mbit/s, with the internal timestamp; a
/// SYNC with a Tx event in the buffers 0 to 2 of each, one of which is requested
/// at each update of TIM2.
fn program() -> Program {
    let mut program = Program::default()
        .store(RCC_APB1ENR1, 1 << 25 | 1)
        .store(RCC_AHB2ENR, 0b11)
        .store(0x4002_1088, 0b10 << 24)
        .store(GPIOA, 0xABFF_FFFF & !(0b0101 << 22) & !(0b01 << 16))
        .store(GPIOA + 0x24, 11 | 9 << 12 | 9 << 16 | 11 << 28)
        .store(GPIOA + 0x400, 0xFFFF_FEBF & !(0b0101 << 24))
        .store(GPIOA + 0x424, 9 << 16 | 9 << 20);
    for (can, ram) in CAN.into_iter().zip(RAM) {
        program = program
            .store(can + 0x18, 0b11)
            .store(can + 0x1C, 12 << 8 | 1)
            .store(can + 0x20, 1)
            .store(can + 0x54, TEFN)
            .store(can + 0x5C, 1)
            .store(ram + TX_BUFFERS, 0x080 << 18)
            .store(ram + TX_BUFFERS + 4, 1 << 23)
            .store(can + 0x18, 0);
    }
    program = program
        .store(NVIC_ISER2, 1 << (IT0[0] - 64) | 1 << (IT0[1] - 64))
        .store(TIM2 + TIM_ARR, 15_999)
        .store(TIM2 + TIM_DIER, 1)
        .store(NVIC_ISER0, 1 << 28)
        .store(TIM2 + TIM_CR1, 1)
        .sleeps();
    let mut tick = store(TIM2 + TIM_SR, 0);
    for can in CAN {
        tick.extend(store(can + TXBAR, 1));
    }
    program = program.handler(TIM2_EXCEPTION, tick);
    for k in 0..2 {
        let (can, ram) = (CAN[k + 1], RAM[k + 1]);
        let mut code = store(can + IR, TEFN);
        code.extend(count(COUNTS[k]));
        code.extend(copy(ram + TX_EVENTS + 4, FIRST[k]));
        code.extend(copy(ram + TX_EVENTS + 20, LAST[k]));
        program = program.handler(FIRST_IRQ + IT0[k], code);
    }
    program
}

/// Runs the board with one other node on each bus; the SYNCs' starts of frame.
fn run(board: &mut Board, until: Time) -> [Vec<Time>; 3] {
    let mut buses: [Bus; 3] = std::array::from_fn(|k| {
        let mut bus = Bus::new(k as u64);
        bus.attach("board");
        let peer = bus.attach("peer");
        bus.set_timing(peer, Some(BitTiming::new(1_000_000, 50.0)), Time::ZERO);
        bus
    });
    let port = crate::bus::PortId(0);
    let mut events: Vec<Event> = Vec::new();
    while board.now() < until {
        let next = buses.iter().filter_map(Bus::next_event).min();
        let t = next.map_or(until, |t| t.min(until));
        let stop = board.run_until(t);
        for (k, bus) in buses.iter_mut().enumerate() {
            match stop {
                Stop::CanChanged => {
                    bus.set_timing(port, board.can_timing(k), board.now());
                    bus.offer(port, board.can_offer(k));
                }
                Stop::Reached => {
                    bus.advance(t, &mut events);
                    for event in events.drain(..).filter(|event| event.port == port) {
                        board.can_event(k, &event);
                    }
                }
                Stop::Fault(ref report) => panic!("{report}"),
            }
        }
    }
    let sync = RecordKind::Frame(WireFrame::standard(0x080, &[]));
    buses.map(|mut bus| {
        let records = bus.take_records();
        let syncs = records.iter().filter(|record| record.kind == sync);
        syncs.map(|record| record.sof).collect()
    })
}

#[test]
fn one_tick_drives_three_buses() {
    let mut board = program().board();
    let syncs = run(&mut board, Time::from_us(1000 * TICKS + 300));
    let ticks = usize::try_from(TICKS).unwrap();
    assert_eq!(syncs.each_ref().map(Vec::len), [ticks; 3]);
    for n in 0..ticks {
        let moments = syncs.each_ref().map(|syncs| syncs[n]);
        let (first, last) = (moments.iter().min(), moments.iter().max());
        let skew = last.unwrap().since(*first.unwrap());
        // The stores of the others, and the bit boundary of each.
        assert!(skew < Time::from_us(2), "{skew} s");
    }
    let sync = board.stats().sync;
    assert_eq!(sync.count, TICKS);
    let between = sync.worst_last_cycles - sync.worst_first_cycles;
    // Twice four instructions and a store.
    assert_eq!(between, 2 * (4 + 2));
}

#[test]
fn tx_events_of_each_tell_when_its_frame_began() {
    let mut board = program().board();
    let syncs = run(&mut board, Time::from_us(1000 * TICKS + 300));
    for k in 0..2 {
        assert_eq!(board.word(COUNTS[k]), Some(0xA5A5_A5A5 + TICKS as u32));
        let stamp = |at| board.word(at).unwrap() & 0xFFFF;
        let told = stamp(LAST[k]) - stamp(FIRST[k]);
        let syncs = &syncs[k + 1];
        let true_us = syncs[2].since(syncs[0]).as_us_f64();
        assert!((f64::from(told) - true_us).abs() <= 1.0, "{told} {true_us}");
    }
}
