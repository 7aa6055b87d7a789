//! The tasks, and what they share.
//!
//! | priority | task | runs |
//! |---|---|---|
//! | 5 | `sync_tick` | TIM2 update, every cycle |
//! | 4 | `can_irq` | FDCAN line 0, and pended when there is something to send; one for each controller |
//! | 3 | `pdo_producer` | pended by the last TPDO, or TIM3 compare at the deadline |
//! | 2 | `network` | TIM7, every millisecond |
//! | 1 | `sdo_configurator` | woken by `can_irq` and `network` |
//! | 0 | `idle` | sleeps |
//!
//! | resource | ceiling | held for |
//! |---|---|---|
//! | `sender` | 5 | one buffer filled and requested |
//! | `od` | 4 | one entry copied |
//! | `lines` | 4 | one frame put in or taken out |
//! | `control` | 3 | one copy |
//!
//! Budgets are cycles at 170 MHz for six axes.

#[rtic::app(device = nucleo_g474re::pac, peripherals = true, dispatchers = [UART4])]
mod app {
    use crate::{
        asking::Asking,
        axes::Axes,
        configurator::{Configurator, Parts},
        control::Control,
        counters::{self, Count},
        derived::{self, AXES, BUSES},
        filters, heartbeats, leds,
        lines::{self, Line, Lines, PRODUCING, SYNCS, Sender},
        log::{News, UPTIME_MS},
        measured::{self, Figure},
        own_node::OwnNode,
        reception::{Receiver, States, queue},
        report::{publish, tell},
        roll::{self, Task},
        wake,
    };
    use canmaster::{
        Frame,
        boot::NetworkBoot,
        design,
        id::{CobId, FunctionCode},
        master::{AxisMap, Debounce, ExtendedClock, MasterOd, Supervisor},
        motion::{AxisCommand, Director, panel::Panel},
        network::Network,
        nmt,
        sync::SyncCounter,
        time::Instant,
    };
    use core::{mem::MaybeUninit, sync::atomic::Ordering};
    use heapless::spsc::{Consumer, Producer, Queue};
    use nucleo_g474re::{Config, can, pins, timers, watchdog::Watchdog};

    type FrameQueue = Queue<Frame, { design::rx_queue(AXES) }>;
    type AnswerQueue = Queue<Frame, { design::answer_queue(AXES) }>;
    type NewsQueue = Queue<News, { design::log_queue(AXES) }>;

    pub(crate) static NETWORK: &Network = &derived::NETWORK;
    pub(crate) static CLOCK: ExtendedClock = ExtendedClock::new();

    static BOARD: Config = {
        const fn settings(peripheral: u8) -> can::Settings {
            can::Settings {
                timing: derived::bit_timing(peripheral),
                filters: &filters::FILTERS,
            }
        }
        let cycle_us = derived::NETWORK.cycle.as_micros();
        assert!(cycle_us <= u16::MAX as u32, "no timer counts that far");
        Config {
            period_us: cycle_us as u16,
            deadline_us: derived::TPDO_DEADLINE_US,
            second_us: derived::WINDOW_US,
            watchdog_ms: design::WATCHDOG_MS,
            can: [settings(1), settings(2), settings(3)],
        }
    };

    #[shared]
    struct Shared {
        od: MasterOd<AXES>,
        sender: Sender,
        lines: Lines,
        control: Control,
        states: States,
        #[lock_free]
        receiver: Receiver,
        phase: timers::Phase,
        clock_us: timers::Microseconds,
        commands: [AxisCommand; AXES],
        axes: &'static mut Axes,
    }

    #[local]
    struct Local {
        period: timers::Period,
        producer: ProducerParts,
        supervisor: Supervisor<AXES>,
        network: NetworkParts,
        configurator: Parts,
    }

    // One resource for each task: its parts are reached from one address.

    struct ProducerParts {
        deadline: timers::Deadline,
        /// The RPDOs of the last cycle came too late to be sent.
        late: bool,
    }

    struct NetworkParts {
        tick: timers::Tick,
        microseconds: timers::Microseconds,
        milliseconds: u32,
        run_led: pins::RunLed,
        error_led: pins::ErrorLed,
        button: pins::Button,
        debounce: Debounce,
        watchdog: Watchdog,
        from_can: Consumer<'static, Frame>,
        states_to: Producer<'static, Frame>,
        news_to: Producer<'static, News>,
        heartbeat: nmt::Producer,
        asking: Asking,
        counts: u32,
        asleep: u32,
        known_bus: can::ErrorState,
    }

    /// Sets up the board and hands each task its part. Runs with interrupts off,
    /// before anything can be late.
    #[init(local = [
        axes: Axes = Axes::ZERO,
        planning: Director<AXES> = Director::ZERO,
        panel: Panel<AXES> = Panel::new(),
        boot_place: MaybeUninit<NetworkBoot<AXES>> = MaybeUninit::uninit(),
        own_place: MaybeUninit<OwnNode> = MaybeUninit::uninit(),
        line_places: [Line; BUSES] = [const { Line::new() }; BUSES],
        network_queue: FrameQueue = Queue::new(),
        answer_queue: AnswerQueue = Queue::new(),
        transfer_queue: FrameQueue = Queue::new(),
        state_queue: AnswerQueue = Queue::new(),
        request_queue: FrameQueue = Queue::new(),
        news_queue: NewsQueue = Queue::new(),
    ])]
    fn init(cx: init::Context) -> (Shared, Local) {
        let board = nucleo_g474re::setup::<{ derived::CAN }>(cx.device, &BOARD);

        let (to_network, from_can) = cx.local.network_queue.split();
        let (answers_to, answers) = cx.local.answer_queue.split();
        let (transfer_to, transfer_answers) = cx.local.transfer_queue.split();
        let (states_to, states) = cx.local.state_queue.split();
        let (news_to, news) = cx.local.news_queue.split();
        let (requests_to, requests) = cx.local.request_queue.split();
        // The first can be; without it, it would be missing in the roll call.
        let _ = sdo_configurator::spawn();
        let own = new_own_node(cx.local.own_place);
        let store = own.load(board.storage);
        let boot = new_boot(cx.local.boot_place, own);
        (
            Shared {
                od: MasterOd::new(&derived::TPDO_BYTES),
                sender: Sender {
                    tx: board.can_tx,
                    sync: lines::element(&Frame::empty(CobId::SYNC)).with_event(),
                    counter: SyncCounter::NONE,
                },
                lines: cx.local.line_places,
                control: Control::new(),
                states: [can::ErrorState::Active; BUSES],
                receiver: Receiver {
                    rx: board.can_rx,
                    phase: board.phase,
                    axis_map: AxisMap::new(NETWORK),
                    to_network,
                    answers_to,
                    transfer_to,
                    requests_to,
                },
                phase: board.phase,
                clock_us: board.microseconds,
                commands: [AxisCommand::default(); AXES],
                axes: configured_axes(cx.local.axes),
            },
            Local {
                period: board.period,
                producer: ProducerParts {
                    deadline: board.deadline,
                    late: false,
                },
                supervisor: Supervisor::new(NETWORK),
                network: NetworkParts {
                    tick: board.tick,
                    microseconds: board.microseconds,
                    milliseconds: 0,
                    run_led: board.run_led,
                    error_led: board.error_led,
                    button: board.button,
                    debounce: Debounce::new(design::BUTTON_SAMPLES),
                    watchdog: board.watchdog,
                    from_can,
                    states_to,
                    news_to,
                    heartbeat: nmt::Producer::new(NETWORK.master.node),
                    asking: Asking::default(),
                    counts: 0,
                    asleep: 0,
                    known_bus: can::ErrorState::Active,
                },
                configurator: Parts {
                    reset_cause: board.reset_cause,
                    clock: board.microseconds,
                    boot,
                    director: configured(cx.local.planning),
                    panel: cx.local.panel,
                    answers,
                    transfer_answers,
                    states,
                    news,
                    own,
                    requests,
                    sync_period: board.sync_period,
                    store,
                },
            },
        )
    }

    fn configured_axes(axes: &'static mut Axes) -> &'static mut Axes {
        axes.group.configure(&derived::GROUP);
        axes
    }

    fn configured(director: &'static mut Director<AXES>) -> &'static mut Director<AXES> {
        director.configure(&derived::GROUP);
        director
    }

    // The largest values are made where they are to stay. Not in `init` itself: what
    // stands in its frame lies below every interrupt's for ever.

    #[inline(never)]
    fn new_boot(
        place: &'static mut MaybeUninit<NetworkBoot<AXES>>,
        own: &OwnNode,
    ) -> &'static mut NetworkBoot<AXES> {
        let settings = own.device.settings().boot();
        NetworkBoot::new_in(place, NETWORK, &settings, Instant::ZERO)
    }

    #[inline(never)]
    fn new_own_node(place: &'static mut MaybeUninit<OwnNode>) -> &'static mut OwnNode {
        place.write(OwnNode::new(NETWORK))
    }

    /// Sleeps until the next interrupt.
    #[idle(shared = [&clock_us])]
    fn idle(cx: idle::Context) -> ! {
        if !measured::ON {
            loop {
                cortex_m::asm::wfi();
            }
        }
        let mut asleep: u32 = 0;
        loop {
            // What wakes it runs when the time is taken.
            cortex_m::interrupt::free(|_| {
                let since = cx.shared.clock_us.now();
                cortex_m::asm::wfi();
                let slept = cx.shared.clock_us.now().wrapping_sub(since);
                asleep = asleep.wrapping_add(slept);
                measured::slept(asleep);
            });
        }
    }

    /// Requests the SYNC of every bus and opens the cycle.
    ///
    /// Trigger: TIM2 update, to the clock tick. Budget: 170 cycles from the
    /// timer's event to the transmit request, 260 to the last of three. If it is
    /// late, the SYNC is, by as much: jitter. If the last SYNC still waits for the
    /// bus, none is sent and that is counted.
    #[task(binds = TIM2, priority = 5, local = [period], shared = [sender, &phase])]
    fn sync_tick(mut cx: sync_tick::Context) {
        if PRODUCING.load(Ordering::Relaxed) {
            cx.shared.sender.lock(Sender::sync);
            let syncs = SYNCS.load(Ordering::Relaxed).wrapping_add(1);
            SYNCS.store(syncs, Ordering::Relaxed);
        }
        cx.local.period.acknowledge();
        // What may go after the SYNC.
        lines::send_now();
        roll::check_in(Task::SyncTick);
        measured::give(Figure::SyncTick, measured::ticks(*cx.shared.phase));
    }

    /// Refills the transmit buffers and empties the receive FIFOs.
    ///
    /// Trigger: FDCAN1 line 0 (frame received, frame sent, error state), or
    /// pended by a task that put something into the transmit queue. Budget: 2000
    /// cycles for three frames each way. If it takes longer than three frames on
    /// the bus (141 us, 24 000 cycles), a FIFO overruns: frames are lost, which
    /// is counted; a lost TPDO is missing in its cycle.
    #[cfg(fdcan1)]
    #[task(binds = FDCAN1_IT0, priority = 4, shared = [od, sender, lines, states, receiver])]
    fn can_irq(mut cx: can_irq::Context) {
        let shared = &mut cx.shared;
        shared.receiver.serve(
            const { derived::bus_of(1) },
            &mut shared.od,
            &mut shared.sender,
            &mut shared.lines,
            &mut shared.states,
        );
        roll::check_in(Task::CanIrq);
    }

    /// The same for FDCAN2.
    #[cfg(fdcan2)]
    #[task(binds = FDCAN2_IT0, priority = 4, shared = [od, sender, lines, states, receiver])]
    fn can_irq_2(mut cx: can_irq_2::Context) {
        let shared = &mut cx.shared;
        shared.receiver.serve(
            const { derived::bus_of(2) },
            &mut shared.od,
            &mut shared.sender,
            &mut shared.lines,
            &mut shared.states,
        );
        roll::check_in(Task::CanIrq);
    }

    /// The same for FDCAN3.
    #[cfg(fdcan3)]
    #[task(binds = FDCAN3_IT0, priority = 4, shared = [od, sender, lines, states, receiver])]
    fn can_irq_3(mut cx: can_irq_3::Context) {
        let shared = &mut cx.shared;
        shared.receiver.serve(
            const { derived::bus_of(3) },
            &mut shared.od,
            &mut shared.sender,
            &mut shared.lines,
            &mut shared.states,
        );
        roll::check_in(Task::CanIrq);
    }

    /// Takes in the TPDOs of this SYNC, steps the axes, and writes the RPDOs that
    /// the next SYNC puts into effect.
    ///
    /// Trigger: pended by the last expected TPDO, or TIM3 compare at the
    /// deadline, whichever is first; once per cycle. Budget: 10 000 cycles of its own
    /// (`bench motion`), and those of what preempts it. If it
    /// has not run before the next SYNC, that cycle is an overrun: it is counted,
    /// and the drives keep the set-points of the cycle before. Several in a row stop
    /// the group (`design::LATE_CYCLES_MAX`); if none gets out for 100 ms, the watchdog
    /// resets the board.
    #[task(
        binds = TIM3,
        priority = 3,
        local = [producer],
        shared = [od, lines, control, commands, axes, &phase]
    )]
    fn pdo_producer(mut cx: pdo_producer::Context) {
        let begun = measured::ticks(*cx.shared.phase);
        let local = cx.local.producer;
        if derived::WINDOW_US != 0 && local.deadline.take_second() {
            lines::send_now();
        }
        let due = local.deadline.take();
        if due && !local.late {
            // Once per period, whatever else pends the task. While no cycle gets its
            // RPDOs out the drives cannot be stopped by them: then the watchdog does.
            roll::check_in(Task::PdoProducer);
        }
        let syncs = SYNCS.load(Ordering::Relaxed);
        let producing = PRODUCING.load(Ordering::Relaxed);
        let Some(cycle) = cx.shared.od.lock(|od| {
            od.follow(syncs);
            od.take_cycle(producing, due)
        }) else {
            return;
        };
        let control = cx.shared.control.lock(Control::take);
        let deadline = &mut local.deadline;
        let shared = &mut cx.shared;
        // Their ceiling is the priority of this task: nobody waits for them.
        let mut theirs = (&mut shared.control, &mut shared.commands, &mut shared.axes);
        theirs.lock(|shared_control, commands, axes| {
            axes.read(&cycle, &mut shared.od);
            axes.step(&cycle, &control, commands);
            shared_control.axes_enabled = axes.enabled(&control);
            local.late = false;
            if deadline.elapsed_us() > control.latest_us {
                local.late = control.leads();
                // What comes after the window of the SYNC is not sent any more.
                Count::RpdoReplaced.add(1);
                axes.skip();
            } else if control.leads() && !control.bus_off {
                if axes.write(&cycle, commands, &mut shared.lines) {
                    lines::send_now();
                }
                local.late = !lines::in_time(cycle.sync, *shared.phase);
                if measured::ON {
                    measured::give(Figure::Cycle, shared.phase.elapsed_us());
                }
            }
            if axes.has_news() {
                wake::want();
            }
        });
        measured::ran(Figure::PdoProducer, *cx.shared.phase, begun);
    }

    /// The worst of the controllers' states.
    fn worst(states: &States) -> can::ErrorState {
        let all = states.iter().copied();
        all.max().unwrap_or(can::ErrorState::Active)
    }

    /// Error control both ways, emergencies, button, LEDs, and the watchdog.
    ///
    /// Trigger: TIM7, every millisecond. Budget: 5 000 cycles. If it is late, so is
    /// the reaction to a lost node; a heartbeat missing for 200 ms stops the
    /// drives; after 100 ms without it the watchdog resets the board.
    #[task(
        binds = TIM7,
        priority = 2,
        local = [network, supervisor],
        shared = [od, lines, control, states, &phase]
    )]
    fn network(mut cx: network::Context) {
        let network::LocalResources {
            network: local,
            supervisor,
            ..
        } = cx.local;
        let begun = measured::ticks(*cx.shared.phase);
        local.tick.acknowledge();
        let counter = local.microseconds.now();
        CLOCK.keep(counter);
        let now = CLOCK.now(|| counter);
        local.milliseconds = local.milliseconds.wrapping_add(1);
        UPTIME_MS.store(local.milliseconds, Ordering::Relaxed);

        while let Some(frame) = local.from_can.dequeue() {
            if let Some((FunctionCode::ErrorControl, _)) = frame.id().split() {
                queue(&mut local.states_to, frame);
                wake::want();
            }
            if let Some(report) = supervisor.on_frame(&frame, now) {
                tell(report, &mut local.news_to, &mut cx.shared.control);
            }
        }
        if local.milliseconds.is_multiple_of(design::SUPERVISION_MS) {
            while let Some(report) = supervisor.poll(now) {
                tell(report, &mut local.news_to, &mut cx.shared.control);
            }
        }
        let bus = cx.shared.states.lock(|states| worst(states));
        let pressed = local.debounce.press(local.button.is_pressed());
        let control = cx.shared.control.lock(|control| {
            control.pressed |= pressed;
            control.bus_off = bus == can::ErrorState::BusOff;
            *control
        });
        if bus != local.known_bus {
            local.known_bus = bus;
            publish(&mut local.news_to, News::ErrorState(bus));
        }
        supervisor.arm(if control.network_ready {
            control.operational
        } else {
            0
        });
        heartbeats::watch(supervisor);
        let heartbeat = heartbeats::producer();
        if control.speaking && local.heartbeat.period() != heartbeat {
            local.heartbeat.set_period(heartbeat, now);
        }
        if let Some(frame) = local.heartbeat.poll(now, control.state())
            && control.speaking
            && !control.bus_off
        {
            lines::send(&mut cx.shared.lines, frame, usize::MAX);
        }
        if control.leads() && !control.bus_off {
            local
                .asking
                .go_on(control.operational, &mut cx.shared.lines);
        }
        if local.milliseconds.is_multiple_of(design::LED_MS) {
            let lost = supervisor.any_lost();
            local.run_led.set(leds::run(&control, now));
            local.error_led.set(leds::error(&control, bus, lost, now));
        }
        if local.milliseconds.is_multiple_of(design::COUNTS_MS) {
            let (overruns, wrong_length) = cx
                .shared
                .od
                .lock(|od| (od.overruns(), od.take_wrong_length()));
            Count::CycleOverruns.set(overruns);
            Count::TxOverflows.set(
                cx.shared
                    .lines
                    .lock(|lines| lines.iter().map(|line| line.planned.overflows()).sum()),
            );
            if measured::ON {
                measured::second(&mut local.asleep, overruns);
                publish(&mut local.news_to, News::Measured);
            }
            if let Some(wrong) = wrong_length {
                publish(&mut local.news_to, News::WrongLength(wrong));
            }
            let counts = counters::sum();
            if counts != local.counts {
                local.counts = counts;
                publish(&mut local.news_to, News::Counts);
            }
        }
        wake::if_due(counter);
        roll::check_in(Task::Network);
        if roll::complete() {
            local.watchdog.feed();
        }
        measured::ran(Figure::Network, *cx.shared.phase, begun);
    }

    /// Boots, checks and configures the nodes, all at once, starts them, and
    /// writes the log.
    ///
    /// Trigger: woken by `network` for a frame, a line of the log, or at the next
    /// deadline of the boot-up. Budget: none; everything else goes first. If it
    /// is starved, nodes take longer to boot, and after 100 ms the watchdog
    /// resets the board.
    #[task(
        priority = 1,
        local = [configurator],
        shared = [od, sender, lines, control, commands, axes]
    )]
    async fn sdo_configurator(cx: sdo_configurator::Context) {
        let mut wake = wake::reader();
        let mut configurator = Configurator::new(cx.local.configurator, cx.shared);
        loop {
            configurator.round();
            wake.wait().await;
        }
    }
}
