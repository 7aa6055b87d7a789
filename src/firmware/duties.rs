//! What `sdo_configurator` does for the boot-up and for the board as a device,
//! with what the tasks share.

use crate::{
    app::app::{NETWORK, sdo_configurator::SharedResources as Shared},
    log::Log,
    own_node::{Mirror, Order, OwnNode, Storage},
};
use canmaster::{
    Frame,
    boot::{Action, NetworkBoot},
    design::{self, AXES},
    device::{Event, Setting},
    master::TxQueue,
    motion::{FaultCause, GroupEvent, GroupState},
    nmt::{Command, NodeControl, Service, State, Target},
    time::Instant,
};
use heapless::spsc::{Consumer, Producer};
use nucleo_g474re::{can, pac::Interrupt, timers};
use rtic::Mutex;

/// The board's own services: takes in one frame, sends one frame. `false`:
/// there was neither.
#[inline(never)]
pub(crate) fn serve(
    own: &mut OwnNode,
    boot: &NetworkBoot<AXES>,
    store: &mut Option<Storage>,
    period: &mut timers::SyncPeriod,
    requests: &mut Consumer<'static, Frame>,
    now: Instant,
    shared: &mut Shared<'_>,
) -> bool {
    let control = shared.control.lock(|control| {
        own.carry_out(control, now);
        *control
    });
    own.restart(now);
    let room = shared
        .tx_queue
        .lock(|queue| queue.len() < design::OWN_FRAMES);
    let board = &mut Mirror {
        network: own.network(),
        boot,
        store,
        od: &mut shared.od,
        commands: &mut shared.commands,
    };
    let changed = own.update(&control, board, now);
    let request = requests.dequeue();
    let frame = match &request {
        Some(request) => own.on_frame(request, now, board),
        None if room => own.device.poll(now, board),
        None => None,
    };
    if changed {
        take_over(Setting::SyncCobId, own, period, shared);
    }
    if let Some(frame) = frame {
        send(frame, shared);
    }
    request.is_some() || frame.is_some()
}

/// Carries out what a client has caused.
pub(crate) fn obey(
    event: &Event,
    own: &OwnNode,
    period: &mut timers::SyncPeriod,
    orders: &mut Producer<'static, Order>,
    shared: &mut Shared<'_>,
) {
    if let Event::Changed(setting) = *event {
        take_over(setting, own, period, shared);
        own.orders(setting, |order| {
            // There is room for the settings of all nodes.
            let _ = orders.enqueue(order);
        });
    }
}

/// Hands on what a client has caused to the boot-up, which sends all NMT
/// commands at its next poll.
#[inline(never)]
pub(crate) fn order_boot(
    event: &Event,
    boot: &mut NetworkBoot<AXES>,
    own: &mut OwnNode,
    now: Instant,
) {
    let control = match *event {
        Event::Nmt(control) => {
            // The boot-up has no say in what the board itself does, except that it
            // starts the network.
            let mine = control.target == Target::Node(own.network().master.node);
            if mine {
                own.command(control);
            }
            if mine && (control.command != Command::Start || !own.device.is_master()) {
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
            return boot.set_settings(&own.device.settings().boot());
        }
        _ => return,
    };
    // The client was refused what it would refuse (`Mirror::may_request`).
    let _ = boot.request(control, now);
}

/// Takes over the settings that were loaded, before the network is started.
pub(crate) fn begin(
    own: &OwnNode,
    period: &mut timers::SyncPeriod,
    orders: &mut Producer<'static, Order>,
    shared: &mut Shared<'_>,
) {
    for setting in [
        Setting::SyncOverflow,
        Setting::ProducerHeartbeat,
        Setting::ConsumerHeartbeat(0),
    ] {
        obey(&Event::Changed(setting), own, period, orders, shared);
    }
}

/// Tells the other tasks where the boot-up stands. When its silence is over, the
/// board leaves initialising, with its boot-up message.
pub(crate) fn follow(boot: &NetworkBoot<AXES>, own: &OwnNode, shared: &mut Shared<'_>) {
    // Queued before `network` may send a heartbeat.
    if !boot.is_silent() && !shared.control.lock(|control| control.speaking) {
        send(own.boot_up(), shared);
    }
    shared.control.lock(|control| control.follow(boot));
}

/// Takes over a setting that a client has changed.
fn take_over(
    setting: Setting,
    own: &OwnNode,
    period: &mut timers::SyncPeriod,
    shared: &mut Shared<'_>,
) {
    if !matches!(
        setting,
        Setting::SyncCobId | Setting::SyncPeriod | Setting::SyncWindow | Setting::SyncOverflow
    ) {
        return;
    }
    let sync = own.device.settings().sync();
    // Nothing longer is taken.
    let us = sync.period() as u16;
    if us != 0 {
        period.set_us(us);
    }
    let differs = sync.period() != own.network().cycle.as_micros();
    let state = own.device.state();
    let produces = sync.is_producing() && state.allows(Service::Sync);
    let anew = setting == Setting::SyncOverflow || state == State::Stopped;
    shared.control.lock(|control| {
        control.cycle_differs = differs;
        control.latest_us = match sync.window() {
            0 => u16::MAX,
            // Nothing shorter than that is taken.
            window => (window as u16).saturating_sub(design::RPDOS_US),
        };
    });
    shared.od.lock(|od| {
        od.set_sync_producer(produces);
        if anew {
            od.set_sync_counter(sync.counter());
        }
    });
}

/// Queues a frame. A full queue counts it: an SDO request is repeated, by us
/// or by the client.
fn send(frame: Frame, shared: &mut Shared<'_>) {
    let _ = shared.tx_queue.lock(|queue| queue.put(frame));
    rtic::pend(Interrupt::FDCAN1_IT0);
}

/// Carries out what the boot-up asks for.
#[inline(never)]
pub(crate) fn act(
    action: &Action,
    own: &mut OwnNode,
    period: &mut timers::SyncPeriod,
    log: &mut Log,
    shared: &mut Shared<'_>,
) {
    match action {
        Action::Send(frame) => send(*frame, shared),
        Action::ProduceSync => {
            own.device.set_sync_producer(true);
            take_over(Setting::SyncCobId, own, period, shared);
        }
        Action::RestartController => {
            shared.tx_queue.lock(TxQueue::clear);
            shared.can_tx.lock(can::Tx::restart);
        }
        Action::Report(event) => {
            own.boot(event);
            shared.control.lock(|control| control.boot(event));
            log.boot(event);
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
                cause: FaultCause::TpdoMissing { .. },
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
