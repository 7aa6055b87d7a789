//! IR, IE, ILS and ILE: flags, groups and lines.

use super::bits::{ILS_GROUPS, ir};
use super::{DiagnosticKind, Env, Fdcan};

impl Fdcan {
    /// Sets interrupt flags.
    pub(super) fn raise(&mut self, flags: u32, env: &mut Env<'_>) {
        let fresh = flags & !self.ir;
        self.ir |= flags;
        self.check_routing(fresh, env);
    }

    /// IR: ones clear.
    pub(super) fn clear_flags(&mut self, value: u32) {
        self.ir &= !value;
    }

    /// The flags that ILS routes to line 1.
    fn line1_mask(&self) -> u32 {
        ILS_GROUPS
            .iter()
            .enumerate()
            .filter(|(group, _)| self.ils & 1 << group != 0)
            .fold(0, |mask, (_, flags)| mask | flags)
    }

    /// The level of interrupt lines IT0 and IT1.
    #[must_use]
    pub(crate) fn lines(&self) -> [bool; 2] {
        let active = self.ir & self.ie;
        let line1 = self.line1_mask();
        [
            self.ile & 0b01 != 0 && active & !line1 != 0,
            self.ile & 0b10 != 0 && active & line1 != 0,
        ]
    }

    /// Notes enabled flags whose line ILE does not enable.
    pub(super) fn check_routing(&self, flags: u32, env: &mut Env<'_>) {
        let line1 = self.line1_mask();
        let mut dead = 0;
        if self.ile & 0b01 == 0 {
            dead |= flags & self.ie & !line1;
        }
        if self.ile & 0b10 == 0 {
            dead |= flags & self.ie & line1;
        }
        for (bit, name) in ir::NAMES.iter().enumerate() {
            if dead & 1 << bit != 0 {
                let line = u8::from(line1 & 1 << bit != 0);
                let text = format!(
                    "FDCAN{}: interrupt {name} is enabled in IE and routed to line {line}, \
                     which ILE does not enable",
                    self.number
                );
                env.log
                    .note(env.at, env.pc, DiagnosticKind::InterruptRouting, text);
            }
        }
    }
}
