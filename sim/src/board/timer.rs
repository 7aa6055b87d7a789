//! TIM2..TIM7: the general-purpose and basic timers (RM0440, 30 and 31).
//!
//! Up-counting with prescaler, auto-reload, four compare channels, preload
//! registers, one-pulse mode and UIFREMAP. Evaluated lazily: the counter is
//! known at one cycle and computed for any later one, flags appear at the exact
//! cycle. Not modelled: capture, output pins, down- and centre-aligned counting,
//! slave modes, dithering (each noted when used).

const CR1: u32 = 0x00;
const CR2: u32 = 0x04;
const SMCR: u32 = 0x08;
const DIER: u32 = 0x0C;
const SR: u32 = 0x10;
const EGR: u32 = 0x14;
const CCMR1: u32 = 0x18;
const CCMR2: u32 = 0x1C;
const CCER: u32 = 0x20;
const CNT: u32 = 0x24;
const PSC: u32 = 0x28;
const ARR: u32 = 0x2C;
const CCR1: u32 = 0x34;
const CCR4: u32 = 0x40;

const CR1_CEN: u32 = 1 << 0;
const CR1_UDIS: u32 = 1 << 1;
const CR1_URS: u32 = 1 << 2;
const CR1_OPM: u32 = 1 << 3;
const CR1_DIR_CMS: u32 = 0b111 << 4;
const CR1_ARPE: u32 = 1 << 7;
const CR1_UIFREMAP: u32 = 1 << 11;
const CR1_DITHEN: u32 = 1 << 12;
const SMCR_SMS: u32 = (1 << 16) | 0b111;
/// SR.UIF, DIER.UIE, EGR.UG.
const UPDATE: u32 = 1 << 0;
/// SR.CC1IF..CC4IF, DIER.CC1IE..CC4IE, EGR.CC1G..CC4G.
const COMPARES: u32 = 0b1111 << 1;
const CNT_UIFCPY: u32 = 1 << 31;
const HALF: u32 = 0xFFFF;
const CHANNELS: usize = 4;

/// What a timer has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TimerKind {
    /// TIM2 and TIM5: 32 bits, four channels.
    Wide,
    /// TIM3 and TIM4: 16 bits, four channels.
    Narrow,
    /// TIM6 and TIM7: 16 bits, no channels.
    Basic,
}

/// One timer.
#[derive(Debug, Clone)]
pub(crate) struct Timer {
    kind: TimerKind,
    cr1: u32,
    cr2: u32,
    smcr: u32,
    dier: u32,
    sr: u32,
    ccmr: [u32; 2],
    ccer: u32,
    psc: u32,
    arr: u32,
    ccr: [u32; CHANNELS],
    psc_shadow: u32,
    arr_shadow: u32,
    ccr_shadow: [u32; CHANNELS],
    /// The counter as of cycle `at`, with `phase` timer clocks of the current
    /// prescaler period already gone.
    cnt: u32,
    at: u64,
    phase: u64,
    /// HCLK cycles per timer clock.
    divisor: u64,
    /// The cycle of the last update that set UIF, and how many there were.
    last_update: u64,
    updates: u64,
}

impl Timer {
    /// A timer in its reset state at `cycle`.
    #[must_use]
    pub(crate) fn new(kind: TimerKind, cycle: u64) -> Self {
        let top = if kind == TimerKind::Wide {
            u32::MAX
        } else {
            HALF
        };
        Self {
            kind,
            cr1: 0,
            cr2: 0,
            smcr: 0,
            dier: 0,
            sr: 0,
            ccmr: [0; 2],
            ccer: 0,
            psc: 0,
            arr: top,
            ccr: [0; CHANNELS],
            psc_shadow: 0,
            arr_shadow: top,
            ccr_shadow: [0; CHANNELS],
            cnt: 0,
            at: cycle,
            phase: 0,
            divisor: 1,
            last_update: 0,
            updates: 0,
        }
    }

    /// HCLK cycles per timer clock, from the APB prescaler.
    pub(crate) fn set_divisor(&mut self, divisor: u64, now: u64) {
        self.sync(now);
        self.divisor = divisor.max(1);
    }

    /// Whether the interrupt line is high.
    #[must_use]
    pub(crate) const fn irq(&self) -> bool {
        self.sr & self.dier & (UPDATE | COMPARES) != 0
    }

    /// How many updates have set UIF, and the cycle of the last one.
    #[must_use]
    pub(crate) const fn updates(&self) -> (u64, u64) {
        (self.updates, self.last_update)
    }

    const fn top(&self) -> u32 {
        if matches!(self.kind, TimerKind::Wide) {
            u32::MAX
        } else {
            HALF
        }
    }

    /// Brings counter and flags up to cycle `now`.
    pub(crate) fn sync(&mut self, now: u64) {
        let clocks = now.saturating_sub(self.at) / self.divisor;
        if self.cr1 & CR1_CEN == 0 || self.arr_shadow == 0 {
            self.at = self.at.max(now);
            return;
        }
        self.at += clocks * self.divisor;
        let mut rest = self.phase + clocks;
        loop {
            let per = u64::from(self.psc_shadow) + 1;
            let limit = if self.cnt <= self.arr_shadow {
                self.arr_shadow
            } else {
                self.top()
            };
            let to_wrap = (u64::from(limit) - u64::from(self.cnt) + 1) * per;
            if rest < to_wrap {
                let ticks = u32::try_from(rest / per).unwrap_or(u32::MAX);
                self.matches(self.cnt, self.cnt + ticks);
                self.cnt += ticks;
                self.phase = rest % per;
                return;
            }
            self.matches(self.cnt, limit);
            rest -= to_wrap;
            self.cnt = 0;
            self.phase = 0;
            self.overflow(self.at - rest * self.divisor);
            if self.cr1 & CR1_CEN == 0 || self.arr_shadow == 0 {
                return;
            }
            rest = self.skip_periods(rest);
        }
    }

    /// Leaves out whole periods that would all do the same.
    fn skip_periods(&mut self, rest: u64) -> u64 {
        let settled = self.psc == self.psc_shadow && self.ccr == self.ccr_shadow;
        let period = (u64::from(self.arr_shadow) + 1) * (u64::from(self.psc_shadow) + 1);
        let whole = rest / period;
        if !settled || whole < 2 {
            return rest;
        }
        let skipped = whole - 1;
        self.matches(0, self.arr_shadow);
        if self.cr1 & CR1_UDIS == 0 {
            self.updates += skipped;
        }
        rest - skipped * period
    }

    /// Sets the compare flags for a counter that went from `from` (not
    /// included) to `to` (included).
    fn matches(&mut self, from: u32, to: u32) {
        if self.kind == TimerKind::Basic {
            return;
        }
        for (channel, &ccr) in self.ccr_shadow.iter().enumerate() {
            if ccr > from && ccr <= to {
                self.sr |= 1 << (channel + 1);
            }
        }
    }

    /// The counter wrapped to zero at `cycle`.
    fn overflow(&mut self, cycle: u64) {
        let arr = self.arr_shadow;
        if self.cr1 & CR1_UDIS == 0 {
            self.load_shadows();
            self.sr |= UPDATE;
            self.updates += 1;
            self.last_update = cycle;
        }
        if self.kind != TimerKind::Basic {
            // A compare value of zero matches as the counter becomes zero; one
            // above ARR sets its flag on the overflow (RM0440, TIMx_SR.CC1IF).
            for (channel, &ccr) in self.ccr_shadow.iter().enumerate() {
                if ccr == 0 || ccr > arr {
                    self.sr |= 1 << (channel + 1);
                }
            }
        }
        if self.cr1 & CR1_OPM != 0 {
            self.cr1 &= !CR1_CEN;
        }
    }

    fn load_shadows(&mut self) {
        self.psc_shadow = self.psc;
        self.arr_shadow = self.arr;
        self.ccr_shadow = self.ccr;
    }

    /// The next cycle after `now` at which an enabled flag may appear.
    #[must_use]
    pub(crate) fn next_event(&self) -> Option<u64> {
        let wanted = self.dier & !self.sr & (UPDATE | COMPARES);
        if self.cr1 & CR1_CEN == 0 || self.arr_shadow == 0 || wanted == 0 {
            return None;
        }
        let limit = if self.cnt <= self.arr_shadow {
            self.arr_shadow
        } else {
            self.top()
        };
        // The overflow is always looked at: new preload values act from there.
        let mut ticks = u64::from(limit) - u64::from(self.cnt) + 1;
        for (channel, &ccr) in self.ccr_shadow.iter().enumerate() {
            if wanted & (1 << (channel + 1)) != 0 && ccr > self.cnt && ccr <= limit {
                ticks = ticks.min(u64::from(ccr - self.cnt));
            }
        }
        let clocks = ticks * (u64::from(self.psc_shadow) + 1) - self.phase;
        Some(self.at + clocks * self.divisor)
    }

    /// The counter as it was at `cycle`, up to one period back.
    #[must_use]
    pub(crate) fn count_at(&mut self, cycle: u64, now: u64) -> u32 {
        self.sync(now);
        if self.cr1 & CR1_CEN == 0 {
            return self.cnt;
        }
        let per = u64::from(self.psc_shadow) + 1;
        let back = now.saturating_sub(cycle) / self.divisor;
        let position = u64::from(self.cnt) * per + self.phase;
        let period = (u64::from(self.arr_shadow) + 1) * per;
        let then = (position + period - back % period) % period;
        u32::try_from(then / per).unwrap_or(u32::MAX)
    }

    /// Reads a register; `None` where there is none.
    pub(crate) fn read(&mut self, offset: u32, now: u64) -> Option<u32> {
        self.sync(now);
        let basic = self.kind == TimerKind::Basic;
        Some(match offset {
            CR1 => self.cr1,
            CR2 => self.cr2,
            DIER => self.dier,
            SR => self.sr,
            EGR => 0,
            CNT if self.cr1 & CR1_UIFREMAP != 0 => {
                let copy = if self.sr & UPDATE != 0 { CNT_UIFCPY } else { 0 };
                (self.cnt & !CNT_UIFCPY) | copy
            }
            CNT => self.cnt,
            PSC => self.psc,
            ARR => self.arr,
            _ if basic => return None,
            SMCR => self.smcr,
            CCMR1 => self.ccmr[0],
            CCMR2 => self.ccmr[1],
            CCER => self.ccer,
            CCR1..=CCR4 => self.ccr[channel_of(offset)],
            _ => return None,
        })
    }

    /// Writes a register. `Err` says in words what the model does not do;
    /// `Ok(false)` that there is no such register.
    pub(crate) fn write(
        &mut self,
        offset: u32,
        value: u32,
        now: u64,
    ) -> Result<bool, &'static str> {
        self.sync(now);
        let top = self.top();
        let basic = self.kind == TimerKind::Basic;
        match offset {
            CR1 => {
                self.cr1 = value;
                if value & CR1_DIR_CMS != 0 {
                    return Err("counts down or centre-aligned, which is not modelled");
                }
                if value & CR1_DITHEN != 0 {
                    return Err("dithers, which is not modelled");
                }
            }
            CR2 => self.cr2 = value,
            DIER => self.dier = value,
            SR => self.sr &= value,
            EGR => self.generate(value),
            CNT => {
                self.cnt = value & top;
                self.phase = 0;
            }
            PSC => self.psc = value & HALF,
            ARR => {
                self.arr = value & top;
                if self.cr1 & CR1_ARPE == 0 {
                    self.arr_shadow = self.arr;
                }
            }
            _ if basic => return Ok(false),
            SMCR => {
                self.smcr = value;
                if value & SMCR_SMS != 0 {
                    return Err("runs in a slave mode, which is not modelled");
                }
            }
            CCMR1 => self.ccmr[0] = value,
            CCMR2 => self.ccmr[1] = value,
            CCER => self.ccer = value,
            CCR1..=CCR4 => {
                let channel = channel_of(offset);
                self.ccr[channel] = value & top;
                if !self.compare_preloaded(channel) {
                    self.ccr_shadow[channel] = self.ccr[channel];
                }
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// CCMRx.OCxPE of a channel.
    const fn compare_preloaded(&self, channel: usize) -> bool {
        const OCPE: u32 = 1 << 3;
        const BITS_PER_CHANNEL: usize = 8;
        let shift = channel % 2 * BITS_PER_CHANNEL;
        self.ccmr[channel / 2] >> shift & OCPE != 0
    }

    /// EGR: an update or compare by software.
    fn generate(&mut self, value: u32) {
        if value & UPDATE != 0 {
            self.cnt = 0;
            self.phase = 0;
            self.load_shadows();
            if self.cr1 & (CR1_URS | CR1_UDIS) == 0 {
                self.sr |= UPDATE;
            }
        }
        if self.kind != TimerKind::Basic {
            self.sr |= value & COMPARES;
        }
    }
}

const fn channel_of(offset: u32) -> usize {
    ((offset - CCR1) / 4) as usize
}

#[cfg(test)]
mod tests;
