//! What `sdo_configurator` does for the boot-up and for the board as a device,
//! with what the tasks share.

use crate::{
    app::app::sdo_configurator::SharedResources as Shared,
    log::Log,
    own_node::{Mirror, Order, OwnNode, Storage},
};
use canmaster::{
    Frame,
    boot::{self, Action, NetworkBoot},
    design::{self, AXES},
    device::{Event, Setting},
    master::TpdoSlots,
    nmt::{Command, NodeControl, Service, State, Target},
    time::Instant,
};
use heapless::spsc::{Consumer, Producer};
use nucleo_g474re::{pac::Interrupt, timers};
use rtic::Mutex;

/// The board's own services: takes in one frame, sends one frame. `false`:
/// there was neither.
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
/// commands. `true`: it has something to do.
pub(crate) fn order_boot(
    event: &Event,
    boot: &mut NetworkBoot<AXES>,
    own: &mut OwnNode,
    now: Instant,
) -> bool {
    let control = match *event {
        Event::Nmt(control) => {
            own.command(control);
            // The boot-up has no say in what the board itself does, except that it
            // starts the network.
            let mine = control.target == Target::Node(own.network().master.node);
            if mine && (control.command != Command::Start || !own.device.is_master()) {
                return false;
            }
            control
        }
        // It is configured whenever it boots.
        Event::Configure(target) => NodeControl {
            command: Command::ResetCommunication,
            target,
        },
        Event::Changed(Setting::Startup | Setting::Assignment(_) | Setting::BootTime) => {
            boot.set_settings(&own.device.settings().boot());
            return true;
        }
        _ => return false,
    };
    // The client was refused what it would refuse (`Mirror::may_request`).
    let _ = boot.request(control, now);
    true
}

/// Takes over the settings that were loaded, before the network is started. A
/// board that is not the NMT master has no network to wait for.
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
    if !own.device.is_master() {
        speak(own.boot_up(), shared);
    }
}

/// The board leaves initialising, with its boot-up message.
fn speak(boot_up: Frame, shared: &mut Shared<'_>) {
    send(boot_up, shared);
    shared.control.lock(|control| control.speaking = true);
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
        control.window_us = sync.window() as u16;
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
        // Only asked for after `NetworkBoot::bus_off`, which nobody calls: the
        // controller stays bus-off until the board is reset.
        Action::RestartController => {}
        Action::Report(event) => {
            own.boot(event);
            if *event == boot::Event::ResetSent && !shared.control.lock(|control| control.speaking)
            {
                speak(own.boot_up(), shared);
            }
            if matches!(event, boot::Event::StartSent) {
                shared.od.lock(|od| od.expect(TpdoSlots::all_of(AXES)));
            }
            shared.control.lock(|control| control.boot(event));
            log.boot(event);
        }
    }
}
