//! IWDG: the independent watchdog on LSI (RM0440, 42).

use super::clock::Frequency;
use crate::time::Time;

const KR: u32 = 0x00;
const PR: u32 = 0x04;
const RLR: u32 = 0x08;
const SR: u32 = 0x0C;
const WINR: u32 = 0x10;
const KEY_FEED: u32 = 0xAAAA;
const KEY_UNLOCK: u32 = 0x5555;
const KEY_START: u32 = 0xCCCC;
const FULL: u32 = 0xFFF;
const PVU: u32 = 1 << 0;
const RVU: u32 = 1 << 1;
const WVU: u32 = 1 << 2;
/// LSI periods until a written value has crossed into the watchdog's domain.
const UPDATE_CLOCKS: u64 = 5;
const SMALLEST_DIVIDER: u64 = 4;
const LARGEST_PRESCALER: u32 = 6;

/// What feeding the watchdog came to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Fed {
    /// In time, or the watchdog does not run.
    InTime,
    /// Before the window opened: reset.
    TooEarly,
}

/// The independent watchdog.
#[derive(Debug, Clone)]
pub(crate) struct Iwdg {
    lsi: Frequency,
    unlocked: bool,
    prescaler: u32,
    reload: u32,
    window: u32,
    /// When the counter was loaded last, if it runs.
    loaded: Option<Time>,
    /// Until when SR shows each value as being updated: PVU, RVU, WVU.
    updating: [Time; 3],
}

impl Iwdg {
    /// Stopped, as after reset (software watchdog in the option bytes).
    #[must_use]
    pub(crate) const fn new(lsi: Frequency) -> Self {
        Self {
            lsi,
            unlocked: false,
            prescaler: 0,
            reload: FULL,
            window: FULL,
            loaded: None,
            updating: [Time::ZERO; 3],
        }
    }

    fn tick(&self) -> Time {
        let divider = SMALLEST_DIVIDER << self.prescaler.min(LARGEST_PRESCALER);
        Time(self.lsi.duration_ps(divider))
    }

    /// When it resets the microcontroller, if it is not fed before.
    #[must_use]
    pub(crate) fn expires(&self) -> Option<Time> {
        Some(self.loaded? + self.tick() * (u64::from(self.reload) + 1))
    }

    /// Reads a register; `None` where there is none.
    #[must_use]
    pub(crate) fn read(&self, offset: u32, now: Time) -> Option<u32> {
        Some(match offset {
            KR => 0,
            PR => self.prescaler,
            RLR => self.reload,
            SR => [PVU, RVU, WVU]
                .iter()
                .zip(self.updating)
                .filter(|&(_, until)| now < until)
                .fold(0, |bits, (bit, _)| bits | bit),
            WINR => self.window,
            _ => return None,
        })
    }

    /// Writes a register. `None` where there is none; `Some(Err)` says what is
    /// wrong with it.
    pub(crate) fn write(
        &mut self,
        offset: u32,
        value: u32,
        now: Time,
    ) -> Option<Result<Fed, &'static str>> {
        let until = now + Time(self.lsi.duration_ps(UPDATE_CLOCKS));
        match offset {
            KR => {
                self.unlocked = false;
                match value {
                    KEY_FEED => return Some(Ok(self.feed(now))),
                    KEY_UNLOCK => self.unlocked = true,
                    KEY_START => self.loaded = Some(self.loaded.unwrap_or(now)),
                    _ => return Some(Err("unknown key")),
                }
            }
            PR | RLR | WINR if !self.unlocked => {
                return Some(Err("written without the key 0x5555: ignored"));
            }
            PR => {
                self.prescaler = value & 0b111;
                self.updating[0] = until;
            }
            RLR => {
                self.reload = value & FULL;
                self.updating[1] = until;
            }
            WINR => {
                self.window = value & FULL;
                self.updating[2] = until;
                // Writing the window reloads the counter.
                return Some(Ok(self.feed_unwindowed(now)));
            }
            SR => {}
            _ => return None,
        }
        Some(Ok(Fed::InTime))
    }

    fn feed_unwindowed(&mut self, now: Time) -> Fed {
        if self.loaded.is_some() {
            self.loaded = Some(now);
        }
        Fed::InTime
    }

    fn feed(&mut self, now: Time) -> Fed {
        let Some(loaded) = self.loaded else {
            return Fed::InTime;
        };
        let gone = now.since(loaded).0 / self.tick().0.max(1);
        let counter = u64::from(self.reload).saturating_sub(gone);
        self.loaded = Some(now);
        if counter > u64::from(self.window) {
            Fed::TooEarly
        } else {
            Fed::InTime
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn started() -> Iwdg {
        let mut iwdg = Iwdg::new(Frequency::from_hz(32_000));
        assert_eq!(iwdg.write(KR, KEY_START, Time::ZERO), Some(Ok(Fed::InTime)));
        iwdg.write(KR, KEY_UNLOCK, Time::ZERO);
        // Divider 32: a tick is a millisecond.
        iwdg.write(PR, 3, Time::ZERO);
        iwdg.write(RLR, 99, Time::ZERO);
        iwdg
    }

    #[test]
    fn expires_after_reload_plus_one_ticks() {
        let mut iwdg = started();
        assert_eq!(iwdg.expires(), Some(Time::from_ms(100)));
        assert_eq!(
            iwdg.write(KR, KEY_FEED, Time::from_ms(60)),
            Some(Ok(Fed::InTime))
        );
        assert_eq!(iwdg.expires(), Some(Time::from_ms(160)));
    }

    #[test]
    fn a_fast_lsi_bites_sooner() {
        let mut iwdg = started();
        iwdg.lsi = Frequency::from_hz(32_000).with_error_ppb(50_000_000);
        assert!(iwdg.expires() < Some(Time::from_ms(96)));
    }

    #[test]
    fn values_need_the_key_and_time() {
        let mut iwdg = started();
        assert_eq!(iwdg.read(SR, Time::ZERO), Some(PVU | RVU));
        assert_eq!(iwdg.read(SR, Time::from_us(157)), Some(0));
        iwdg.write(KR, KEY_FEED, Time::ZERO);
        assert!(matches!(iwdg.write(RLR, 5, Time::ZERO), Some(Err(_))));
        assert_eq!(iwdg.read(RLR, Time::ZERO), Some(99));
        assert_eq!(iwdg.read(0x14, Time::ZERO), None);
    }

    #[test]
    fn feeding_before_the_window_opens_resets() {
        let mut iwdg = started();
        iwdg.write(WINR, 50, Time::ZERO);
        assert_eq!(
            iwdg.write(KR, KEY_FEED, Time::from_ms(20)),
            Some(Ok(Fed::TooEarly))
        );
        assert_eq!(
            iwdg.write(KR, KEY_FEED, Time::from_ms(80)),
            Some(Ok(Fed::InTime))
        );
    }

    #[test]
    fn it_does_not_run_before_it_is_started() {
        let mut iwdg = Iwdg::new(Frequency::from_hz(32_000));
        assert_eq!(iwdg.expires(), None);
        iwdg.write(KR, KEY_FEED, Time::from_s(9));
        assert_eq!(iwdg.expires(), None);
    }
}
