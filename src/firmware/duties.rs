//! What `sdo_configurator` does for the boot-up and for the board as a device,
//! with what the tasks share.

use crate::{
    app::app::sdo_configurator::SharedResources as Shared,
    log::Log,
    own_node::{Mirror, Order, OwnNode},
};
use canmaster::{
    Frame,
    boot::{self, Action, NetworkBoot},
    design::{self, AXES},
    device::{Event, Setting},
    master::TpdoSlots,
    nmt::{Command, NodeControl},
    time::Instant,
};
use heapless::spsc::{Consumer, Producer};
use nucleo_g474re::{pac::Interrupt, timers};
use rtic::Mutex;

/// The board's own services: takes in one frame, sends one frame. `false`:
/// there was neither.
pub(crate) fn serve(
    own: &mut OwnNode,
    requests: &mut Consumer<'static, Frame>,
    now: Instant,
    shared: &mut Shared<'_>,
) -> bool {
    let control = shared.control.lock(|control| *control);
    let room = shared
        .tx_queue
        .lock(|queue| queue.len() < design::OWN_FRAMES);
    let board = &mut Mirror {
        network: own.network(),
        od: &mut shared.od,
        commands: &mut shared.commands,
    };
    own.update(&control, board, now);
    let request = requests.dequeue();
    let frame = match &request {
        Some(request) => own.device.on_frame(request, now, board),
        None if room => own.device.poll(now, board),
        None => None,
    };
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
    match *event {
        Event::Changed(setting) => {
            take_over(setting, own, period, shared);
            own.orders(setting, |order| {
                // There is room for the settings of all nodes.
                let _ = orders.enqueue(order);
            });
        }
        _ => {}
    }
}

/// Hands on what a client has caused to the boot-up, which sends all NMT
/// commands. `true`: it has something to do.
pub(crate) fn order_boot(
    event: &Event,
    boot: &mut NetworkBoot<AXES>,
    own: &OwnNode,
    now: Instant,
) -> bool {
    let control = match *event {
        Event::Nmt(control) => control,
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
    if let Err(refusal) = boot.request(control, now) {
        defmt::warn!("NMT request refused: {}", refusal);
    }
    true
}

/// Takes over a setting that a client has changed.
fn take_over(
    setting: Setting,
    own: &OwnNode,
    period: &mut timers::SyncPeriod,
    shared: &mut Shared<'_>,
) {
    if !matches!(setting, Setting::SyncCobId | Setting::SyncPeriod) {
        return;
    }
    let sync = own.device.settings().sync();
    let us = u16::try_from(sync.period()).ok().filter(|us| *us != 0);
    if let Some(us) = us {
        period.set_us(us);
    } else {
        defmt::warn!(
            "no SYNC: its period (1006h) is {=u32} us, at most {=u16} possible",
            sync.period(),
            u16::MAX
        );
    }
    let differs = sync.period() != own.network().cycle.as_micros();
    let produces = sync.cob_id().is_producer() && us.is_some();
    shared
        .control
        .lock(|control| control.cycle_differs = differs);
    shared.od.lock(|od| od.set_sync_producer(produces));
}

/// Queues a frame. A full queue counts it: an SDO request is repeated, by us
/// or by the client.
fn send(frame: Frame, shared: &mut Shared<'_>) {
    let _ = shared.tx_queue.lock(|queue| queue.put(frame));
    rtic::pend(Interrupt::FDCAN1_IT0);
}

/// Carries out what the boot-up asks for.
pub(crate) fn act(action: &Action, log: &mut Log, shared: &mut Shared<'_>) {
    match action {
        Action::Send(frame) => send(*frame, shared),
        Action::ProduceSync => shared.od.lock(|od| od.set_sync_producer(true)),
        // Only asked for after `NetworkBoot::bus_off`, which nobody calls: the
        // controller stays bus-off until the board is reset.
        Action::RestartController => {}
        Action::Report(event) => {
            if *event == boot::Event::StartSent {
                shared.od.lock(|od| od.expect(TpdoSlots::all_of(AXES)));
            }
            shared.control.lock(|control| control.boot(event));
            log.boot(event);
        }
    }
}
