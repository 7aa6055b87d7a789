//! What the slower tasks tell the PDO producer and each other.

use crate::derived::AXES;
use canmaster::{
    boot::{Event, NetworkBoot},
    motion::FaultCause,
    nmt,
};

/// Shared by `pdo_producer`, `network` and `sdo_configurator`.
#[expect(unreachable_pub, reason = "RTIC wants shared resources to be public")]
#[derive(Clone, Copy)]
pub struct Control {
    /// The silent phase is over: the master may speak.
    pub(crate) speaking: bool,
    /// NMT start was sent, or is left to others: RPDOs go out every cycle.
    pub(crate) started: bool,
    /// Every mandatory node is checked, configured and operational.
    pub(crate) network_ready: bool,
    /// The nodes that are operational: bit n for axis n.
    pub(crate) operational: u32,
    /// The mandatory nodes that the network cannot do without, and has to.
    pub(crate) missing: u32,
    /// A node was given up: it counts as lost, even if it was never seen.
    pub(crate) node_missing: bool,
    /// The button was pressed.
    pub(crate) pressed: bool,
    /// A fault seen outside the group that it does not know of yet.
    pub(crate) fault: Option<(usize, FaultCause)>,
    /// A mandatory node could not be booted.
    pub(crate) boot_failed: bool,
    /// The controller is bus-off.
    pub(crate) bus_off: bool,
    /// An axis is or is being enabled.
    pub(crate) axes_enabled: bool,
    /// 1006h is not the cycle that the group is made for: no axis is enabled.
    pub(crate) cycle_differs: bool,
    /// When RPDOs may be handed over at the latest to be sent within 1007h, in
    /// microseconds after the SYNC.
    pub(crate) latest_us: u16,
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
            operational: 0,
            missing: 0,
            node_missing: false,
            pressed: false,
            fault: None,
            boot_failed: false,
            bus_off: false,
            axes_enabled: false,
            cycle_differs: false,
            latest_us: u16::MAX,
            commanded: None,
        }
    }

    /// Takes note of a step of the boot-up.
    pub(crate) fn boot(&mut self, event: &Event) {
        match event {
            Event::StartSent | Event::StartLeft => {
                self.started = true;
                self.commanded = None;
            }
            Event::BusOff { .. } => (self.speaking, self.started) = (false, false),
            _ => {}
        }
    }

    /// Takes note of where the boot-up stands.
    pub(crate) fn follow(&mut self, boot: &NetworkBoot<AXES>) {
        self.network_ready = boot.is_ready();
        self.operational = boot.operational();
        self.missing = boot.missing();
        self.node_missing = boot.any_given_up();
        self.boot_failed = boot.is_failed();
        self.speaking |= !boot.is_silent();
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
