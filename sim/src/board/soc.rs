//! The microcontroller around the core: address map, clock gating, interrupts.

mod access;
mod can;
mod flash;

use super::clock::{CoreClock, Frequency};
use super::diagnostics::{DiagnosticKind, DiagnosticLog};
use super::exti::Exti;
use super::fdcan::Fdcan;
use super::flash::Flash;
use super::gpio::{PORTS, Pin, Port};
use super::iwdg::Iwdg;
use super::pwr::Pwr;
use super::rcc::{HSI_HZ, LSI_HZ, Oscillators, Rcc, ResetCause};
use super::sync_probe::SyncProbe;
use super::timer::{Timer, TimerKind};
use crate::time::Time;

/// Timers in the order of [`Soc::timers`], with their interrupts.
const TIMER_KINDS: [(TimerKind, u8, &str); 6] = [
    (TimerKind::Wide, 28, "TIM2"),
    (TimerKind::Narrow, 29, "TIM3"),
    (TimerKind::Narrow, 30, "TIM4"),
    (TimerKind::Wide, 50, "TIM5"),
    (TimerKind::Basic, 54, "TIM6"),
    (TimerKind::Basic, 55, "TIM7"),
];
const TIM2: usize = 0;
const TIM3: usize = 1;
/// TIM2's interrupt: the SYNC task's.
pub(crate) const TIM2_IRQ: u8 = 28;
/// Interrupts IT0 and IT1 of FDCAN1..3.
const CAN_IRQS: [[u8; 2]; 3] = [[21, 22], [86, 87], [88, 89]];
/// FLASH's interrupt: end of operation, error.
const FLASH_IRQ: u8 = 4;
/// DBGMCU_IDCODE of an STM32G47x/G48x, revision X.
const IDCODE: u32 = 0x2001_6469;
const DBGMCU_WORDS: usize = 5;

/// Where an access comes from.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Access {
    /// The core's cycle.
    pub cycle: u64,
    /// The instruction.
    pub pc: u32,
}

/// Errors of the board's oscillators.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct ClockErrors {
    /// Of the 24 MHz crystal, parts per billion.
    pub hse_ppb: i64,
    /// Of the internal 16 MHz oscillator, parts per billion.
    pub hsi_ppb: i64,
    /// Of the internal 32 kHz oscillator, parts per billion.
    pub lsi_ppb: i64,
}

/// The STM32G474's peripherals.
#[derive(Debug)]
pub(crate) struct Soc {
    /// The core's clock.
    pub clock: CoreClock,
    rcc: Rcc,
    pwr: Pwr,
    flash: Flash,
    ports: [Port; PORTS],
    exti: Exti,
    timers: [Timer; 6],
    iwdg: Iwdg,
    dbgmcu: [u32; DBGMCU_WORDS],
    can: [Fdcan; 3],
    /// Mistakes of the program.
    pub log: DiagnosticLog,
    /// From the timer's update to the SYNC's request.
    pub sync: SyncProbe,
    reset_request: Option<ResetCause>,
}

impl Soc {
    /// Power-on at time zero.
    #[must_use]
    pub(crate) fn new(errors: ClockErrors, sync_cob_id: u16, flash: Flash) -> Self {
        const HSE_HZ: u32 = 24_000_000;
        let oscillators = Oscillators {
            hse: Frequency::from_hz(HSE_HZ).with_error_ppb(errors.hse_ppb),
            hsi: Frequency::from_hz(HSI_HZ).with_error_ppb(errors.hsi_ppb),
            lsi: Frequency::from_hz(LSI_HZ).with_error_ppb(errors.lsi_ppb),
        };
        let mut soc = Self {
            clock: CoreClock::new(oscillators.hsi, 0, Time::ZERO),
            rcc: Rcc::new(oscillators, ResetCause::PowerOn, 0),
            pwr: Pwr::default(),
            flash,
            ports: std::array::from_fn(Port::new),
            exti: Exti::default(),
            timers: TIMER_KINDS.map(|(kind, _, _)| Timer::new(kind, 0)),
            iwdg: Iwdg::new(oscillators.lsi),
            dbgmcu: [0; DBGMCU_WORDS],
            can: std::array::from_fn(|k| Fdcan::new(k + 1)),
            log: DiagnosticLog::default(),
            sync: SyncProbe::new(sync_cob_id),
            reset_request: None,
        };
        soc.scramble();
        soc
    }

    /// Message RAM after power-on holds anything.
    fn scramble(&mut self) {
        const PATTERN: u32 = 0x5A5A_A5A5;
        for can in &mut self.can {
            can.ram.scramble(PATTERN);
        }
    }

    /// Resets everything at `cycle`, which is at `time`.
    pub(crate) fn reset(&mut self, cause: ResetCause, cycle: u64, time: Time) {
        let flags = if cause == ResetCause::PowerOn {
            0
        } else {
            self.rcc.reset_flags()
        };
        let oscillators = self.rcc.oscillators();
        self.rcc = Rcc::new(oscillators, cause, flags);
        self.clock = CoreClock::new(self.rcc.hclk(), cycle, time);
        self.pwr = Pwr::default();
        self.flash.reset(time);
        for (index, port) in self.ports.iter_mut().enumerate() {
            port.reset(index);
        }
        self.exti = Exti::default();
        self.timers = TIMER_KINDS.map(|(kind, _, _)| Timer::new(kind, cycle));
        self.iwdg = Iwdg::new(oscillators.lsi);
        for can in &mut self.can {
            can.reset();
        }
        if cause == ResetCause::PowerOn {
            self.scramble();
            self.dbgmcu = [0; DBGMCU_WORDS];
        }
        self.sync.restart();
        self.reset_request = None;
    }

    /// A reset that a peripheral asks for.
    pub(crate) fn take_reset_request(&mut self) -> Option<ResetCause> {
        self.reset_request.take()
    }

    /// Brings everything that runs by itself up to `cycle`.
    pub(crate) fn advance(&mut self, cycle: u64) {
        for timer in &mut self.timers {
            timer.sync(cycle);
        }
        let (updates, last) = self.timers[TIM2].updates();
        self.sync.note_updates(updates, last);
        let now = self.clock.time_of(cycle);
        self.flash.advance(now);
        if self.iwdg.expires().is_some_and(|at| at <= now) {
            self.reset_request = Some(ResetCause::Watchdog);
        }
        self.tick_can(cycle);
    }

    /// The next cycle at which something happens by itself.
    #[must_use]
    pub(crate) fn next_event(&self) -> u64 {
        let timers = self.timers.iter().filter_map(Timer::next_event).min();
        let watchdog = self.iwdg.expires();
        let times = [watchdog, self.next_can_event(), self.flash.next_event()];
        let other = times.into_iter().flatten().min();
        let other = other.map(|at| self.clock.cycle_at(at));
        timers.into_iter().chain(other).min().unwrap_or(u64::MAX)
    }

    /// Levels of all interrupt lines, one bit each.
    #[must_use]
    pub(crate) fn irq_levels(&self) -> u128 {
        let mut levels = 0;
        for (timer, (_, irq, _)) in self.timers.iter().zip(TIMER_KINDS) {
            if timer.irq() {
                levels |= 1 << irq;
            }
        }
        for (can, irqs) in self.can.iter().zip(CAN_IRQS) {
            for (high, irq) in can.lines().into_iter().zip(irqs) {
                if high {
                    levels |= 1 << irq;
                }
            }
        }
        if self.flash.irq() {
            levels |= 1 << FLASH_IRQ;
        }
        self.exti.irqs(|irq| levels |= 1 << irq);
        levels
    }

    /// Drives a pin from outside.
    pub(crate) fn drive(&mut self, pin: Pin, high: bool) {
        if let Some(port) = self.ports.get_mut(pin.port) {
            port.drive(pin.number, high);
        }
        self.sample_pins();
    }

    /// Whether the program drives a pin high.
    #[must_use]
    pub(crate) fn is_high(&self, pin: Pin) -> bool {
        self.ports
            .get(pin.port)
            .is_some_and(|port| port.is_output_high(pin.number))
    }

    fn sample_pins(&mut self) {
        let inputs = std::array::from_fn(|k| self.ports[k].input());
        self.exti.sample(&inputs);
    }

    /// After a change of clocks: anchors the core's clock anew and looks
    /// whether voltage and wait states allow it.
    fn clocks_changed(&mut self, access: Access) {
        let hclk = self.rcc.hclk();
        if hclk != self.clock.frequency() {
            self.clock.change(hclk, access.cycle);
        }
        let divisor = self.rcc.timer_divisor();
        for timer in &mut self.timers {
            timer.set_divisor(divisor, access.cycle);
        }
        for can in &mut self.can {
            can.mark_changed();
        }
        self.check_clocks(access);
    }

    fn check_clocks(&mut self, access: Access) {
        if let Some(text) = self.flash.check(self.rcc.hclk().hz(), self.pwr.range()) {
            self.note(access, DiagnosticKind::Clocks, text);
        }
    }

    fn note(&mut self, access: Access, kind: DiagnosticKind, text: impl Into<String>) {
        let at = self.clock.time_of(access.cycle);
        self.log.note(at, access.pc, kind, text);
    }
}

/// Names an interrupt for messages and tables.
#[must_use]
pub(crate) fn irq_name(irq: u8) -> String {
    if let Some((_, _, name)) = TIMER_KINDS.iter().find(|(_, number, _)| *number == irq) {
        return (*name).to_string();
    }
    for (k, irqs) in CAN_IRQS.iter().enumerate() {
        if let Some(line) = irqs.iter().position(|&number| number == irq) {
            return format!("FDCAN{}_IT{line}", k + 1);
        }
    }
    match irq {
        FLASH_IRQ => "FLASH".to_string(),
        6..=10 => format!("EXTI{}", irq - 6),
        23 => "EXTI9_5".to_string(),
        40 => "EXTI15_10".to_string(),
        // No models: real-time frameworks take them for software tasks.
        52 => "UART4".to_string(),
        53 => "UART5".to_string(),
        _ => format!("IRQ{irq}"),
    }
}
