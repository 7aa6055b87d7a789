use super::super::{DiagnosticKind, Led, ResetCause, irqs};
use super::on_the_bus::{CAN1, CAN1_TX, can_program};
use super::*;
use crate::bus::{Event, EventKind, PortId};
use crate::frame::WireFrame;

#[test]
fn a_timer_wakes_the_core_exactly_on_time() {
    let mut handler = store(TIM2 + TIM_SR, 0);
    handler.extend(count(SRAM));
    // 16 MHz after reset: an update every millisecond.
    let mut board = Program::default()
        .store(SRAM, 0)
        .tim2_every(16_000)
        .sleeps()
        .handler(TIM2_EXCEPTION, handler)
        .board();
    assert_eq!(board.run(Time::from_us(10_500)), Stop::Reached);
    assert_eq!(board.word(SRAM), Some(10));
    let stats = board.stats();
    let tim2 = stats.irq(irqs::TIM2).expect("was taken");
    assert_eq!(tim2.count, 10);
    // Twelve cycles of entry after the wake-up.
    assert_eq!(tim2.worst_latency_cycles, 12);
    // Entry; three MOVW and MOVT; STR, LDR, STR; ADDS; BX LR with the return.
    assert_eq!(tim2.worst_cycles, 12 + 3 * 2 + 3 * 2 + 1 + 1 + 10);
    assert_eq!(stats.cycles, 168_000);
    assert!(
        stats.cpu_load() < 0.01,
        "asleep most of the time: {}",
        stats.cpu_load()
    );
    assert!(board.diagnostics().is_empty(), "{:?}", board.diagnostics());
    // One exception frame of 32 bytes.
    assert_eq!(stats.stack_high_water_bytes, 32);
    assert_eq!(stats.stack_size_bytes, 0x2000);
}

#[test]
fn systick_counts_on_in_sleep() {
    let mut board = Program::default()
        .store(SRAM, 0)
        .store(SYST_RVR, 15_999)
        .store(SYST_CSR, 0b111)
        .sleeps()
        .handler(SYSTICK_EXCEPTION, count(SRAM))
        .board();
    board.run(Time::from_us(5_500));
    assert_eq!(board.word(SRAM), Some(5));
}

#[test]
fn interrupts_off_and_masked_are_measured_from_the_first_interrupt_on() {
    let mut handler = store(TIM2 + TIM_SR, 0);
    handler.push(CPSID_I);
    handler.extend([NOP; 50]);
    handler.push(CPSIE_I);
    // BASEPRI at TIM2's priority for so many cycles and back.
    let masked = |nops: usize| {
        let mut code = load(1, 0x50).to_vec();
        code.extend(MSR_BASEPRI_R1);
        code.extend(vec![NOP; nops]);
        code.extend(load(1, 0));
        code.extend(MSR_BASEPRI_R1);
        code
    };
    // In its own handler that holds nobody back.
    handler.extend(masked(60));
    let mut board = Program::default()
        .then([CPSID_I])
        .then([NOP; 200])
        .then([CPSIE_I])
        .store(NVIC_IPR_TIM2 & !3, 0x50)
        .store(SYST_RVR, 15_999)
        .store(SYST_CSR, 0b111)
        .tim2_every(16_000)
        .sleeps()
        .handler(TIM2_EXCEPTION, handler)
        .handler(SYSTICK_EXCEPTION, masked(30))
        .board();
    board.run(Time::from_ms(3));
    let stats = board.stats();
    assert_eq!(stats.irq_off_max_cycles, 51);
    assert_eq!(stats.startup_irq_off_cycles, 201);
    assert_eq!(stats.sync_masked_max_cycles, 30 + 2 + 1);
}

#[test]
fn a_delayed_interrupt_comes_late_and_a_blocked_one_not_at_all() {
    let mut handler = store(TIM2 + TIM_SR, 0);
    handler.extend(count(SRAM));
    let mut board = Program::default()
        .store(SRAM, 0)
        .tim2_every(16_000)
        .sleeps()
        .handler(TIM2_EXCEPTION, handler)
        .board();
    board.delay_irq(irqs::TIM2, 3_000, 7);
    board.run(Time::from_us(20_500));
    let stats = board.stats();
    let worst = stats
        .irq(irqs::TIM2)
        .expect("was taken")
        .worst_latency_cycles;
    assert!((1_000..=3_012).contains(&worst), "{worst}");
    assert_eq!(board.word(SRAM), Some(20));
    board.delay_irq(irqs::TIM2, 0, 0);
    board.block_irq(irqs::TIM2, true);
    board.run(Time::from_us(30_500));
    assert_eq!(board.word(SRAM), Some(20));
    board.block_irq(irqs::TIM2, false);
    board.run(Time::from_us(30_600));
    assert_eq!(board.word(SRAM), Some(21), "the flag is still set");
}

#[test]
fn an_interrupt_that_nobody_serves_is_noted() {
    let mut board = Program::default()
        .store(RCC_APB1ENR1, 1)
        .store(TIM2 + TIM_ARR, 15_999)
        .store(TIM2 + TIM_DIER, 1)
        .store(TIM2 + TIM_CR1, 1)
        .sleeps()
        .board();
    board.run(Time::from_ms(300));
    let kinds: Vec<_> = board.diagnostics().iter().map(|entry| entry.kind).collect();
    assert_eq!(kinds, [DiagnosticKind::InterruptRouting]);
    assert!(board.diagnostics()[0].text.contains("TIM2"));
}

#[test]
fn an_unclocked_peripheral_does_nothing_and_is_noted_with_its_place() {
    let mut board = Program::default()
        .store(GPIOA, 0)
        .store(0x4001_2C00, 1)
        .store(0x4002_1058 + 0x70, 1)
        .sleeps()
        .board();
    board.run(Time::from_ms(1));
    let entries = board.diagnostics();
    let kinds: Vec<_> = entries.iter().map(|entry| entry.kind).collect();
    use DiagnosticKind::{Unclocked, Unmodelled};
    assert_eq!(kinds, [Unclocked, Unmodelled, Unmodelled]);
    assert_eq!(entries[0].pc, FLASH_BASE + CODE as u32 + 16, "the STR");
}

#[test]
fn button_and_led() {
    // PA5 as output, set; PC13 as input, copied to SRAM for ever.
    let copy_loop = copy(GPIOC + 0x10, SRAM);
    let back = 0xE000 | (0x800 - (copy_loop.len() as u16 + 2)) & 0x7FF;
    let mut board = Program::default()
        .store(RCC_AHB2ENR, 0b101)
        .store(GPIOA, 0xABFF_F7FF)
        .store(GPIOA + 0x18, 1 << 5)
        .store(GPIOC, 0xF3FF_FFFF)
        .then(copy_loop)
        .then([back])
        .board();
    board.run(Time::from_us(100));
    assert!(board.led(Led::Run));
    assert!(!board.led(Led::Error));
    assert_eq!(board.word(SRAM), Some(0));
    board.set_button(true);
    board.run(Time::from_us(200));
    assert_eq!(board.word(SRAM), Some(1 << 13));
}

#[test]
fn the_controller_offers_frames_and_interrupts_for_received_ones() {
    let mut handler = store(CAN1 + 0x50, 1);
    handler.extend(count(SRAM));
    let mut board = can_program()
        .store(SRAM, 0)
        .store(CAN1_TX, 0x080 << 18)
        .store(CAN1_TX + 4, 0)
        .store(CAN1 + 0xCC, 1)
        .sleeps()
        .handler(16 + 21, handler)
        .board();
    let mut offered_at = None;
    while board.run_until(Time::from_ms(1)) == Stop::CanChanged {
        if let Some(offer) = board.can_offer(0) {
            offered_at = Some((board.now(), offer));
        }
    }
    let (now, offer) = offered_at.expect("a SYNC is offered");
    assert_eq!(offer.frame, WireFrame::standard(0x080, &[]));
    assert!(offer.ready_at > now, "before the frame may start");
    let timing = board.can_timing(0).expect("on the bus");
    assert_eq!(
        (timing.bit_time_ps, timing.sample_point_permille),
        (1_000_000, 875)
    );
    assert_eq!(board.can_timing(1), None);
    let frame = WireFrame::standard(0x181, &[1, 2]);
    let event = Event {
        at: Time::from_ms(1),
        port: PortId(0),
        kind: EventKind::Rx {
            frame,
            sof: Time::from_us(900),
        },
    };
    board.can_event(0, &event);
    board.run(Time::from_us(1_010));
    assert_eq!(board.word(SRAM), Some(1));
    assert!(board.diagnostics().is_empty(), "{:?}", board.diagnostics());
}

#[test]
fn in_reset_the_controller_is_off_the_bus() {
    let mut board = can_program().sleeps().board();
    board.run(Time::from_ms(1));
    assert!(board.can_timing(0).is_some());
    board.hold_in_reset();
    assert_eq!(board.run_until(Time::from_ms(2)), Stop::CanChanged);
    assert_eq!(board.can_timing(0), None);
    assert_eq!(board.run_until(Time::from_ms(3)), Stop::Reached);
    assert_eq!(board.now(), Time::from_ms(3));
    board.release_reset();
    board.run(Time::from_ms(4));
    assert!(board.can_timing(0).is_some());
    let resets = board.stats().resets;
    assert_eq!(resets.len(), 2);
    assert_eq!(
        (resets[1].cause, resets[1].at),
        (ResetCause::Pin, Time::from_ms(3))
    );
}

#[test]
fn the_core_stops_for_nothing_but_time_while_it_sleeps() {
    let mut board = Program::default().sleeps().board();
    board.run(Time::from_s(3600));
    let stats = board.stats();
    assert_eq!(stats.cycles, 3600 * 16_000_000);
    assert!(stats.steps < 10);
}
