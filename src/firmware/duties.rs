//! What `sdo_configurator` does for the boot-up and for the board as a device,
//! with what the tasks share.

use crate::{
    app::app::NETWORK,
    asking,
    configurator::Configurator,
    derived::{AXES, CONTROLLERS, RPDOS_US},
    heartbeats,
    lines::{self, Line, PRODUCING},
    own_node::Mirror,
};
use canmaster::{
    Frame,
    boot::{self, Action, NetworkBoot},
    design,
    device::{Event, Setting},
    motion::{Cause, FaultCause, GroupEvent, GroupState},
    nmt::{Command, NodeControl, Service, State, Target},
};
use core::sync::atomic::Ordering::Relaxed;
use rtic::mutex_prelude::*;

impl Configurator<'_> {
    /// The board's own services: takes in one frame, sends one frame. `false`:
    /// there was neither.
    pub(crate) fn serve(&mut self) -> bool {
        let now = self.now();
        let control = self.shared.control.lock(|control| {
            self.local.own.carry_out(control, now);
            *control
        });
        self.local.own.restart(now);
        let room = lines::have_room(&mut self.shared.lines, design::OWN_FRAMES);
        let board = &mut Mirror {
            network: NETWORK,
            boot: self.local.boot,
            store: &mut self.local.store,
            od: &mut self.shared.od,
            commands: &mut self.shared.commands,
            axes: &mut self.shared.axes,
            director: self.local.director,
            panel: self.local.panel,
        };
        let changed = self.local.own.update(&control, board, now);
        let request = self.local.requests.dequeue();
        let frame = match &request {
            Some(request) => self.local.own.on_frame(request, now, board),
            None if room => self.local.own.device.poll(now, board),
            None => None,
        };
        if changed {
            self.take_over(Setting::SyncCobId);
        }
        if let Some(frame) = frame {
            self.send(frame);
        }
        request.is_some() || frame.is_some()
    }

    /// Carries out what a client has caused.
    pub(crate) fn obey(&mut self, event: &Event) {
        let control = match *event {
            Event::Nmt(control) => {
                // The boot-up has no say in what the board itself does, except that
                // it starts the network.
                let mine = control.target == Target::Node(NETWORK.master.node);
                if mine {
                    self.local.own.command(control);
                }
                if mine && (control.command != Command::Start || !self.local.own.device.is_master())
                {
                    return;
                }
                control
            }
            // It is configured whenever it boots.
            Event::Configure(target) => NodeControl {
                command: Command::ResetCommunication,
                target,
            },
            Event::Changed(Setting::Startup | Setting::Assignment(_) | Setting::BootTime) => {
                let settings = self.local.own.device.settings().boot();
                return self.local.boot.set_settings(&settings);
            }
            Event::Changed(setting) => {
                self.take_over(setting);
                return heartbeats::give(setting, self.local.own.device.settings());
            }
            _ => return,
        };
        // It sends all NMT commands at its next poll. The client was refused what it
        // would refuse (`Mirror::may_request`).
        let _ = self.local.boot.request(control, self.now());
    }

    /// Tells the other tasks where the boot-up stands. When its silence is over, the
    /// board leaves initialising, with its boot-up message.
    pub(crate) fn follow(&mut self) {
        // Queued before `network` may send a heartbeat.
        if !self.local.boot.is_silent() && !self.shared.control.lock(|control| control.speaking) {
            self.send(self.local.own.boot_up());
        }
        self.shared
            .control
            .lock(|control| control.follow(self.local.boot));
    }

    /// Takes over a setting that a client has changed.
    #[inline(never)]
    fn take_over(&mut self, setting: Setting) {
        if !matches!(
            setting,
            Setting::SyncCobId | Setting::SyncPeriod | Setting::SyncWindow | Setting::SyncOverflow
        ) {
            return;
        }
        let sync = self.local.own.device.settings().sync();
        // Nothing longer is taken.
        let us = sync.period() as u16;
        if us != 0 {
            self.local.sync_period.set_us(us);
        }
        let differs = sync.period() != NETWORK.cycle.as_micros();
        let state = self.local.own.device.state();
        let produces = sync.is_producing() && state.allows(Service::Sync);
        let anew = setting == Setting::SyncOverflow || state == State::Stopped;
        let latest_us = match sync.window() {
            0 => u16::MAX,
            // Nothing shorter than that is taken.
            window => (window as u16).saturating_sub(RPDOS_US),
        };
        let shared = &mut self.shared;
        (&mut shared.control, &mut shared.sender).lock(|control, sender| {
            control.cycle_differs = differs;
            control.latest_us = latest_us;
            PRODUCING.store(produces, Relaxed);
            if anew {
                sender.counter = sync.counter();
            }
        });
    }

    /// Queues a frame. A full queue counts it: an SDO request is repeated, by us
    /// or by the client.
    pub(crate) fn send(&mut self, frame: Frame) {
        lines::send(&mut self.shared.lines, frame, usize::MAX);
    }

    /// Carries out what the boot-up asks for.
    pub(crate) fn act(&mut self, action: &Action) {
        match action {
            Action::Send(frame) => self.send(*frame),
            Action::ProduceSync => {
                self.local.own.device.set_sync_producer(true);
                self.take_over(Setting::SyncCobId);
            }
            Action::RestartController => {
                self.shared
                    .lines
                    .lock(|lines| lines.iter_mut().for_each(Line::clear));
                for controller in CONTROLLERS {
                    self.shared
                        .sender
                        .lock(|sender| sender.tx.restart(controller));
                }
            }
            Action::Report(event) => {
                if let boot::Event::Operational(node) | boot::Event::NodeBack(node) = event
                    && let Some(frame) = asking::quieten(*node)
                {
                    self.send(frame);
                }
                self.local.own.boot(event);
                self.shared.control.lock(|control| control.boot(event));
                self.log.boot(event);
            }
        }
    }
}

/// Axes whose TPDOs stay away: whatever their heartbeats say, they are of no use
/// as they are. One bit for each.
#[derive(Default)]
pub(crate) struct Silent(u32);

impl Silent {
    /// Takes note of what the group reports. When everything stands, the nodes of
    /// these axes are booted again.
    pub(crate) fn group(&mut self, event: &GroupEvent, boot: &mut NetworkBoot<AXES>) {
        match *event {
            GroupEvent::Fault {
                axis: Some(axis),
                cause:
                    FaultCause {
                        cause: Cause::TpdoMissing,
                        ..
                    },
            } => self.0 |= 1 << axis,
            GroupEvent::State {
                to: GroupState::Faulted,
                ..
            } => {
                for (axis, node) in NETWORK.nodes.iter().enumerate() {
                    if self.0 & 1 << axis != 0 {
                        boot.node_lost(node.id);
                    }
                }
                self.0 = 0;
            }
            _ => {}
        }
    }
}
