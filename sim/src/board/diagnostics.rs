//! Wrong register use, told with time, place and words.

use std::collections::BTreeMap;
use std::fmt;

use crate::time::Time;

/// What kind of mistake a [`Diagnostic`] tells of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum DiagnosticKind {
    /// A peripheral was accessed whose clock RCC does not enable.
    Unclocked,
    /// A register was accessed that the emulated board does not have.
    Unmodelled,
    /// A register was accessed with a width the hardware does not take.
    Width,
    /// The core's clock, its voltage range and the flash wait states do not
    /// go together.
    Clocks,
    /// A timer was told to do what the model does not do.
    Timer,
    /// A protected FDCAN register was written, or a mode is not modelled.
    CanRegister,
    /// A Tx element was written or requested that was not free to use.
    CanTxElement,
    /// A remote frame was requested where CANopen has none.
    CanRemoteFrame,
    /// A received frame was lost because its FIFO was full.
    CanOverrun,
    /// The controller takes part in the bus, but its pins do not.
    CanPins,
    /// An interrupt that is enabled at its source reaches nobody.
    InterruptRouting,
    /// The watchdog was used in a way that has no effect.
    Watchdog,
    /// The flash was written or erased out of order.
    Flash,
}

/// One mistake, told once with the number of times it happened.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Diagnostic {
    /// When it happened first.
    pub at: Time,
    /// The program counter of the access; 0 where no instruction caused it.
    pub pc: u32,
    /// What kind of mistake it is.
    pub kind: DiagnosticKind,
    /// What happened, in words.
    pub text: String,
    /// How often.
    pub count: u64,
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const PS_PER_US: u64 = 1_000_000;
        write!(f, "{} us: {}", self.at.0 / PS_PER_US, self.text)?;
        if self.pc != 0 {
            write!(f, " (at 0x{:08x})", self.pc)?;
        }
        if self.count > 1 {
            write!(f, ", {} times", self.count)?;
        }
        Ok(())
    }
}

/// Collects diagnostics; the same words are kept once and counted.
#[derive(Debug, Clone, Default)]
pub(crate) struct DiagnosticLog {
    entries: Vec<Diagnostic>,
    index: BTreeMap<(DiagnosticKind, String), usize>,
    total: u64,
}

impl DiagnosticLog {
    /// Notes that something happened at `at`, done by the instruction at `pc`.
    pub(crate) fn note(
        &mut self,
        at: Time,
        pc: u32,
        kind: DiagnosticKind,
        text: impl Into<String>,
    ) {
        let text = text.into();
        self.total += 1;
        let key = (kind, text);
        if let Some(entry) = self.index.get(&key).and_then(|&i| self.entries.get_mut(i)) {
            entry.count += 1;
            return;
        }
        self.entries.push(Diagnostic {
            at,
            pc,
            kind,
            text: key.1.clone(),
            count: 1,
        });
        self.index.insert(key, self.entries.len() - 1);
    }

    /// Everything noted so far, in the order of first occurrence.
    #[must_use]
    pub(crate) fn entries(&self) -> &[Diagnostic] {
        &self.entries
    }

    /// Sum of the counts: changes whenever something is noted.
    #[must_use]
    pub(crate) const fn total(&self) -> u64 {
        self.total
    }
}
