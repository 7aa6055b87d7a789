//! What `sdo_configurator` does each time it runs: the board's own services, the
//! boot-up of the network, the log.

use crate::{
    app::app::{CLOCK, NETWORK, sdo_configurator as task},
    duties::{Silent, act, begin, follow, obey, order_boot, serve},
    log::{self, Log},
    roll::{self, Task},
    transfer::{self, Transfer},
    wake,
};
use canmaster::{design, device::MasterError, nmt::State, time::Instant};
use nucleo_g474re::{reset_cause::ResetCause, timers};
use rtic::Mutex;

/// The task with what it has.
pub(crate) struct Configurator<'a> {
    local: task::LocalResources<'a>,
    shared: task::SharedResources<'a>,
    log: Log,
    silent: Silent,
    transfer: Option<Transfer>,
}

impl<'a> Configurator<'a> {
    /// Tells how the board was started, and takes over its settings.
    pub(crate) fn new(
        local: task::LocalResources<'a>,
        mut shared: task::SharedResources<'a>,
    ) -> Configurator<'a> {
        log::started(*local.reset_cause);
        defmt::info!(
            "silent for {=u32} ms, so that drives left running come to rest",
            NETWORK.master.silence.as_millis()
        );
        if *local.reset_cause == ResetCause::Watchdog {
            local.own.device.raise(MasterError::Watchdog);
        }
        if local.store.is_none() {
            defmt::warn!("settings are not stored (1010h): set option bit DBANK, then flash again");
        }
        begin(local.own, local.sync_period, local.orders_to, &mut shared);
        Configurator {
            local,
            shared,
            log: Log::new(NETWORK),
            silent: Silent::default(),
            transfer: None,
        }
    }

    /// Does what there is to do, and asks to be woken for what comes next. The test
    /// transfer first, for whose speed every microsecond counts; then the
    /// requests of clients first, since they may have something to say to the
    /// boot-up; the frames that it sends are on their way at the end.
    pub(crate) fn round(&mut self) {
        let tested = transfer::go_on(
            &mut self.transfer,
            self.local.own.device.transfer(),
            self.local.transfer_answers,
            &mut self.shared.tx_queue,
            now(*self.local.clock),
        );
        self.serve();
        let bus_off = self.listen();
        // A board that is stopped has neither SDO nor SYNC: the boot-up waits.
        let held = self.local.own.device.state() == State::Stopped && !bus_off;
        self.boot(held);
        roll::check_in(Task::SdoConfigurator);
        let boots = self.local.boot.next_deadline().filter(|_| !held);
        let mut next = now(*self.local.clock) + design::CONFIGURATOR_PERIOD;
        for deadline in [boots, self.local.own.device.next_deadline(), tested] {
            next = deadline.map_or(next, |deadline| deadline.min(next));
        }
        wake::at(next.as_micros() as u32);
    }

    /// The board's own services.
    fn serve(&mut self) {
        let local = &mut self.local;
        let shared = &mut self.shared;
        while serve(
            local.own,
            local.boot,
            local.store,
            local.sync_period,
            local.requests,
            now(*local.clock),
            shared,
        ) {
            while let Some(event) = local.own.device.take_event() {
                obey(
                    &event,
                    local.own,
                    local.sync_period,
                    local.orders_to,
                    shared,
                );
                order_boot(&event, local.boot, local.own, now(*local.clock));
            }
        }
    }

    /// What the other tasks have to say. `true`: the controller is bus-off.
    fn listen(&mut self) -> bool {
        let local = &mut self.local;
        while let Some(news) = local.news.dequeue() {
            // Who is just being booted has to be silent for a while.
            let lost = news.lost_node();
            if lost.is_none_or(|node| local.boot.node_lost(node)) {
                local.own.news(&news);
                self.log.news(&news);
            }
        }
        while let Some(event) = local.events.dequeue() {
            self.silent.group(&event, local.boot);
            local.own.group(&event);
            self.log.group(&event);
        }
        let bus_off = self.shared.control.lock(|control| control.bus_off);
        // The controller had the silent phase to come back in.
        if bus_off && !local.boot.is_silent() {
            local.boot.bus_off(now(*local.clock));
        }
        bus_off
    }

    /// The boot-up: the time first, then one frame at a time, since each may
    /// cause several actions, which are carried out before the next.
    fn boot(&mut self, held: bool) {
        let local = &mut self.local;
        loop {
            while !held && let Some(action) = local.boot.poll(now(*local.clock)) {
                act(
                    &action,
                    local.own,
                    local.sync_period,
                    &mut self.log,
                    &mut self.shared,
                );
            }
            follow(local.boot, local.own, &mut self.shared);
            let state = || {
                let frame = local.states.dequeue();
                frame.inspect(|frame| local.own.error_control(frame))
            };
            let Some(frame) = local.answers.dequeue().or_else(state) else {
                break;
            };
            local.boot.on_frame(&frame, now(*local.clock));
        }
    }
}

#[inline(never)]
fn now(clock: timers::Microseconds) -> Instant {
    CLOCK.now(|| clock.now())
}
