//! What the slower tasks tell the PDO producer and each other.

use canmaster::{boot::Event, motion::FaultCause, nmt};

/// Shared by `pdo_producer`, `network` and `sdo_configurator`.
#[expect(unreachable_pub, reason = "RTIC wants shared resources to be public")]
#[derive(Clone, Copy)]
pub struct Control {
    /// The silent phase is over: the master may speak.
    pub(crate) speaking: bool,
    /// NMT start was sent: RPDOs go out every cycle.
    pub(crate) started: bool,
    /// Every mandatory node is checked, configured and operational.
    pub(crate) network_ready: bool,
    /// The button was pressed.
    pub(crate) pressed: bool,
    /// A fault seen outside the group that it does not know of yet.
    pub(crate) fault: Option<(usize, FaultCause)>,
    /// A mandatory node could not be booted.
    pub(crate) boot_failed: bool,
    /// The controller is or was bus-off.
    pub(crate) bus_off: bool,
    /// An axis is or is being enabled.
    pub(crate) axes_enabled: bool,
    /// 1006h is not the cycle that the group is made for: no axis is enabled.
    pub(crate) cycle_differs: bool,
    /// 1007h, microseconds; 0: none.
    pub(crate) window_us: u16,
    /// The NMT state that a command has brought the board to; `None`: the one
    /// that the start of the network has.
    pub(crate) commanded: Option<nmt::State>,
}

impl Control {
    pub(crate) const fn new() -> Control {
        Control {
            speaking: false,
            started: false,
            network_ready: false,
            pressed: false,
            fault: None,
            boot_failed: false,
            bus_off: false,
            axes_enabled: false,
            cycle_differs: false,
            window_us: 0,
            commanded: None,
        }
    }

    /// Takes note of a step of the boot-up.
    pub(crate) fn boot(&mut self, event: &Event) {
        match event {
            Event::ResetSent => self.speaking = true,
            Event::StartSent => {
                self.started = true;
                self.commanded = None;
            }
            Event::NetworkReady => self.network_ready = true,
            Event::NetworkFailed => self.boot_failed = true,
            _ => {}
        }
    }

    /// The NMT state of the board itself.
    pub(crate) const fn state(&self) -> nmt::State {
        match (self.speaking, self.commanded, self.started) {
            (false, ..) => nmt::State::Initialising,
            (true, Some(state), _) => state,
            (true, None, false) => nmt::State::PreOperational,
            (true, None, true) => nmt::State::Operational,
        }
    }

    /// Whether PDOs are exchanged with the drives.
    pub(crate) const fn leads(&self) -> bool {
        self.started && matches!(self.state(), nmt::State::Operational)
    }

    /// Tells the group of a fault; of several between two cycles, the first.
    pub(crate) fn tell_fault(&mut self, axis: usize, cause: FaultCause) {
        self.fault.get_or_insert((axis, cause));
    }

    /// For a step of the group: the button and the fault are taken, so that each
    /// counts once.
    pub(crate) fn take(&mut self) -> Control {
        let taken = *self;
        self.pressed = false;
        self.fault = None;
        taken
    }
}
