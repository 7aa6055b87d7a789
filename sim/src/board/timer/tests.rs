use super::*;

fn write(timer: &mut Timer, offset: u32, value: u32, now: u64) {
    assert_eq!(timer.write(offset, value, now), Ok(true));
}

/// TIM2 as the SYNC timer has it: PSC 0, ARR = 1_700_000 - 1.
fn sync_timer() -> Timer {
    let mut timer = Timer::new(TimerKind::Wide, 0);
    write(&mut timer, ARR, 1_699_999, 0);
    write(&mut timer, EGR, UPDATE, 0);
    write(&mut timer, SR, 0, 0);
    write(&mut timer, DIER, UPDATE, 0);
    write(&mut timer, CR1, CR1_CEN, 100);
    timer
}

#[test]
fn an_update_comes_every_arr_plus_one_clocks() {
    let mut timer = sync_timer();
    assert_eq!(timer.next_event(), Some(100 + 1_700_000));
    timer.sync(1_700_099);
    assert!(!timer.irq());
    timer.sync(1_700_100);
    assert!(timer.irq());
    assert_eq!(timer.updates(), (1, 1_700_100));
    // The flag stays until a zero is written to it; writing ones changes nothing.
    write(&mut timer, SR, !UPDATE | UPDATE, 1_700_105);
    assert!(timer.irq());
    write(&mut timer, SR, !UPDATE, 1_700_110);
    assert!(!timer.irq());
    assert_eq!(timer.next_event(), Some(100 + 2 * 1_700_000));
    assert_eq!(timer.read(CNT, 1_700_150), Some(50));
}

#[test]
fn the_prescaler_is_loaded_by_the_update_event() {
    let mut timer = Timer::new(TimerKind::Wide, 0);
    write(&mut timer, PSC, 169, 0);
    write(&mut timer, CR1, CR1_CEN, 0);
    // Without an update the prescaler still divides by one.
    assert_eq!(timer.read(CNT, 100), Some(100));
    write(&mut timer, EGR, UPDATE, 100);
    assert_eq!(timer.read(CNT, 100 + 169), Some(0));
    assert_eq!(timer.read(CNT, 100 + 170), Some(1));
    assert_eq!(timer.read(CNT, 100 + 170 * 1000), Some(1000));
}

#[test]
fn urs_keeps_a_software_update_silent() {
    let mut timer = Timer::new(TimerKind::Basic, 0);
    write(&mut timer, EGR, UPDATE, 0);
    assert_eq!(timer.read(SR, 0), Some(UPDATE));
    write(&mut timer, SR, 0, 0);
    write(&mut timer, CR1, CR1_URS, 0);
    write(&mut timer, EGR, UPDATE, 0);
    assert_eq!(timer.read(SR, 0), Some(0));
}

#[test]
fn a_compare_sets_its_flag_at_the_exact_cycle() {
    let mut timer = Timer::new(TimerKind::Narrow, 0);
    write(&mut timer, PSC, 169, 0);
    write(&mut timer, ARR, 9_999, 0);
    write(&mut timer, EGR, UPDATE, 0);
    write(&mut timer, SR, 0, 0);
    write(&mut timer, CCR1, 4_000, 0);
    write(&mut timer, DIER, 1 << 1, 0);
    write(&mut timer, CR1, CR1_CEN, 0);
    assert_eq!(timer.next_event(), Some(4_000 * 170));
    timer.sync(4_000 * 170 - 1);
    assert!(!timer.irq());
    timer.sync(4_000 * 170);
    assert!(timer.irq());
    write(&mut timer, SR, !(1 << 1), 4_000 * 170 + 5);
    // The next look is at the overflow, the next match a period later.
    assert_eq!(timer.next_event(), Some(10_000 * 170));
    timer.sync(10_000 * 170);
    assert_eq!(timer.next_event(), Some(14_000 * 170));
}

#[test]
fn preloaded_values_wait_for_the_update() {
    let mut timer = Timer::new(TimerKind::Narrow, 0);
    write(&mut timer, CR1, CR1_ARPE, 0);
    write(&mut timer, ARR, 99, 0);
    write(&mut timer, EGR, UPDATE, 0);
    write(&mut timer, CR1, CR1_ARPE | CR1_CEN, 0);
    write(&mut timer, ARR, 49, 10);
    assert_eq!(timer.read(CNT, 99), Some(99));
    assert_eq!(timer.read(CNT, 100 + 49), Some(49));
    assert_eq!(timer.read(CNT, 100 + 50), Some(0));
}

#[test]
fn one_pulse_stops_at_the_update() {
    let mut timer = Timer::new(TimerKind::Basic, 0);
    write(&mut timer, ARR, 9, 0);
    write(&mut timer, CR1, CR1_CEN | CR1_OPM, 0);
    assert_eq!(timer.read(CNT, 1000), Some(0));
    assert_eq!(timer.read(CR1, 1000), Some(CR1_OPM));
    assert_eq!(timer.updates(), (1, 10));
}

#[test]
fn a_sixteen_bit_timer_keeps_sixteen_bits() {
    let mut timer = Timer::new(TimerKind::Narrow, 0);
    write(&mut timer, ARR, 0x12_3456, 0);
    assert_eq!(timer.read(ARR, 0), Some(0x3456));
    assert_eq!(
        timer.write(SMCR, 0b110, 0),
        Err("runs in a slave mode, which is not modelled")
    );
    let mut basic = Timer::new(TimerKind::Basic, 0);
    assert_eq!(basic.read(CCR1, 0), None);
    assert_eq!(basic.write(CCR1, 1, 0), Ok(false));
}

#[test]
fn uifremap_shows_the_flag_in_the_counter() {
    let mut timer = Timer::new(TimerKind::Wide, 0);
    write(&mut timer, ARR, 999, 0);
    write(&mut timer, CR1, CR1_CEN | CR1_UIFREMAP, 0);
    assert_eq!(timer.read(CNT, 5), Some(5));
    assert_eq!(timer.read(CNT, 1005), Some(CNT_UIFCPY | 5));
}

#[test]
fn long_gaps_lose_nothing() {
    let mut timer = Timer::new(TimerKind::Narrow, 0);
    write(&mut timer, ARR, 3, 0);
    write(&mut timer, CR1, CR1_CEN, 0);
    assert_eq!(timer.read(CNT, 4_000_000_002), Some(2));
    assert_eq!(timer.updates(), (1_000_000_000, 4_000_000_000));
}

#[test]
fn a_slower_bus_slows_the_timer() {
    let mut timer = Timer::new(TimerKind::Wide, 0);
    write(&mut timer, CR1, CR1_CEN, 0);
    timer.set_divisor(2, 100);
    assert_eq!(timer.read(CNT, 200), Some(150));
}

#[test]
fn the_count_of_a_moment_ago() {
    let mut timer = Timer::new(TimerKind::Narrow, 0);
    write(&mut timer, PSC, 9, 0);
    write(&mut timer, ARR, 99, 0);
    write(&mut timer, EGR, UPDATE, 0);
    write(&mut timer, CR1, CR1_CEN, 0);
    assert_eq!(timer.count_at(1_100, 1_205), 10);
    assert_eq!(timer.count_at(950, 1_205), 95);
}
