//! What `sdo_configurator` does each time it runs: the board's own services, the
//! boot-up of the network, the log.

use crate::{
    app::app::{CLOCK, NETWORK, sdo_configurator as task},
    derived::{AXES, PROGRAM},
    duties::Silent,
    lines::SYNCS,
    log::{self, Log, News},
    own_node::{OwnNode, Storage},
    roll::{self, Task},
    settings::Settings,
    transfer::{self, Transfer},
    wake,
};
use canmaster::{
    Frame,
    boot::NetworkBoot,
    design,
    device::{Event, MasterError, Setting},
    motion::{Director, panel::Panel},
    nmt::State,
    time::{Duration, Instant},
};
use core::sync::atomic::Ordering::Relaxed;
use heapless::spsc::Consumer;
use nucleo_g474re::{
    reset_cause::ResetCause,
    timers::{Microseconds, SyncPeriod},
};
use rtic::Mutex;

/// So many cycles are longer than the period in any case.
const CYCLES_MAX: u32 = 1000;
const CYCLE_US: u32 = NETWORK.cycle.as_micros();

/// What is the task's alone.
pub(crate) struct Parts {
    pub(crate) reset_cause: ResetCause,
    pub(crate) clock: Microseconds,
    pub(crate) boot: &'static mut NetworkBoot<AXES>,
    pub(crate) director: &'static mut Director<AXES>,
    pub(crate) panel: &'static mut Panel<AXES>,
    pub(crate) answers: Consumer<'static, Frame>,
    pub(crate) transfer_answers: Consumer<'static, Frame>,
    pub(crate) states: Consumer<'static, Frame>,
    pub(crate) news: Consumer<'static, News>,
    pub(crate) own: &'static mut OwnNode,
    pub(crate) requests: Consumer<'static, Frame>,
    pub(crate) sync_period: SyncPeriod,
    pub(crate) store: Option<Storage>,
}

/// The task with what it has.
pub(crate) struct Configurator<'a> {
    pub(crate) local: &'a mut Parts,
    pub(crate) shared: task::SharedResources<'a>,
    pub(crate) log: Log,
    silent: Silent,
    transfer: Option<Transfer>,
    settings: Settings,
    /// SYNCs that the device was told of.
    syncs: u32,
}

impl<'a> Configurator<'a> {
    /// Tells how the board was started, and takes over its settings.
    pub(crate) fn new(local: &'a mut Parts, shared: task::SharedResources<'a>) -> Configurator<'a> {
        log::started(
            local.reset_cause,
            NETWORK.master.silence.as_millis(),
            local.store.is_some(),
        );
        if local.reset_cause == ResetCause::Watchdog {
            local.own.device.raise(MasterError::Watchdog);
        }
        let mut configurator = Configurator {
            local,
            shared,
            log: Log::new(NETWORK),
            silent: Silent::default(),
            transfer: None,
            settings: Settings::NONE,
            syncs: 0,
        };
        for setting in [
            Setting::SyncOverflow,
            Setting::ProducerHeartbeat,
            Setting::ConsumerHeartbeat(0),
        ] {
            configurator.obey(&Event::Changed(setting));
        }
        configurator
    }

    /// Does what there is to do, and asks to be woken for what comes next. The test
    /// transfer first, for whose speed every microsecond counts; then the
    /// requests of clients first, since they may have something to say to the
    /// boot-up; the frames that it sends are on their way at the end.
    pub(crate) fn round(&mut self) {
        let now = self.now();
        let tested = transfer::go_on(
            &mut self.transfer,
            self.local.own.device.transfer(),
            &mut self.local.transfer_answers,
            &mut self.shared.lines,
            now,
        );
        let syncs = SYNCS.load(Relaxed);
        let device = &mut self.local.own.device;
        device.on_syncs(syncs.wrapping_sub(self.syncs));
        self.syncs = syncs;
        while self.serve() {
            while let Some(event) = self.local.own.device.take_event() {
                self.obey(&event);
            }
        }
        self.direct();
        let bus_off = self.listen();
        // A board that is stopped has neither SDO nor SYNC: the boot-up waits.
        let held = self.local.own.device.state() == State::Stopped && !bus_off;
        self.boot(held);
        self.set();
        roll::check_in(Task::SdoConfigurator);
        let boots = self.local.boot.next_deadline().filter(|_| !held);
        let mut next = self.now() + design::CONFIGURATOR_PERIOD;
        // 0 wraps: nothing is waited for.
        let patience = self
            .local
            .director
            .patience()
            .wrapping_sub(1)
            .min(CYCLES_MAX)
            + 1;
        let motion = self.now() + Duration::from_micros(patience * CYCLE_US);
        next = motion.min(next);
        if self.local.own.device.sends_tpdos() {
            next = next.min(self.now() + NETWORK.cycle);
        }
        for deadline in [boots, self.local.own.device.next_deadline(), tested] {
            next = deadline.map_or(next, |deadline| deadline.min(next));
        }
        wake::at(next.as_micros() as u32);
    }

    /// Plans motion: with the group only as long as it takes to look at it, and to
    /// hand over what is planned.
    fn direct(&mut self) {
        let director = &mut *self.local.director;
        let panel = &mut *self.local.panel;
        let plan = self.shared.axes.lock(|axes| {
            if core::mem::take(&mut axes.pressed) {
                panel.press(&mut axes.group, director);
            }
            panel.poll(&mut axes.group);
            let program = panel.program().unwrap_or(PROGRAM.as_slice());
            director.look(&mut axes.group, program)
        });
        let program = panel.program().unwrap_or(PROGRAM.as_slice());
        if plan {
            director.think(program);
            self.shared
                .axes
                .lock(|axes| director.act(&mut axes.group, program));
        }
    }

    /// What the other tasks have to say. `true`: the controller is bus-off.
    fn listen(&mut self) -> bool {
        let now = self.now();
        let local = &mut self.local;
        while let Some(news) = local.news.dequeue() {
            if let Some(node) = news.cut_off_node() {
                local.boot.node_cut_off(node, now);
            }
            // Who is just being booted has to be silent for a while.
            let lost = news.lost_node();
            if lost.is_none_or(|node| local.boot.node_lost(node)) {
                local.own.news(&news);
                self.log.news(&news);
            }
        }
        while let Some(event) = self.shared.axes.lock(|axes| axes.group.take_event()) {
            self.silent.group(&event, local.boot);
            local.own.group(&event);
            local.panel.on_event(&event);
            self.log.group(&event);
        }
        let bus_off = self.shared.control.lock(|control| control.bus_off);
        // The controller had the silent phase to come back in.
        if bus_off && !local.boot.is_silent() {
            let now = self.now();
            self.local.boot.bus_off(now);
        }
        bus_off
    }

    /// The boot-up: the time first, then one frame at a time, since each may
    /// cause several actions, which are carried out before the next.
    fn boot(&mut self, held: bool) {
        loop {
            while !held && let Some(action) = self.local.boot.poll(self.now()) {
                self.act(&action);
            }
            self.follow();
            let frame = match self.local.answers.dequeue() {
                None => self.local.states.dequeue(),
                answer => answer,
            };
            let Some(frame) = frame else {
                break;
            };
            // It leaves the answers of SDO servers alone.
            self.local.own.error_control(&frame);
            let now = self.now();
            if !self.settings.on_frame(&frame, now) {
                self.local.boot.on_frame(&frame, now);
            }
        }
    }

    /// Writes to a drive what the group wants it to show, and tells it when it does.
    fn set(&mut self) {
        let shown = self.settings.take_shown();
        let wanted = self.shared.axes.lock(|axes| {
            if let Some(shown) = shown {
                axes.group.confirm(shown);
            }
            axes.group.wanted()
        });
        let now = self.now();
        if let Some(frame) = self.settings.poll(wanted, now) {
            self.send(frame);
        }
    }

    #[inline(never)]
    pub(crate) fn now(&self) -> Instant {
        CLOCK.now(|| self.local.clock.now())
    }
}
