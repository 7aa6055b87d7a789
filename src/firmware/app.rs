//! The tasks and what they share.

#[rtic::app(device = nucleo_g474re::pac, peripherals = true, dispatchers = [UART4])]
mod app {
    use crate::{
        counters,
        filters::{self, Handler},
        roll::{self, Task},
    };
    use canmaster::{
        Frame, design,
        id::{CobId, FunctionCode, NodeId},
        master::{Debounce, ExtendedClock, MasterOd, Reception, TpdoSlot, TxQueue},
        time::{Duration, Instant},
    };
    use heapless::spsc::{Consumer, Producer, Queue};
    use nucleo_g474re::{Config, can, pac::Interrupt, pins, timers, watchdog::Watchdog};
    use rtic_sync::signal::Signal;

    type FrameQueue = Queue<Frame, { design::RX_QUEUE }>;

    static CLOCK: ExtendedClock = ExtendedClock::new();
    static WAKE: Signal<()> = Signal::new();
    static LENGTHS: [[u8; 2]; design::AXES] = [[6, 6]; design::AXES];

    #[shared]
    struct Shared {
        od: MasterOd<{ design::AXES }>,
        can_tx: can::Tx,
        tx_queue: TxQueue<{ design::TX_QUEUE }>,
    }

    #[local]
    struct Local {
        period: timers::Period,
        sync: can::Element,
        can_rx: can::Rx,
        to_network: Producer<'static, Frame>,
        to_configurator: Producer<'static, Frame>,
        deadline: timers::Deadline,
        tick: timers::Tick,
        microseconds: timers::Microseconds,
        run_led: pins::RunLed,
        error_led: pins::ErrorLed,
        button: pins::Button,
        debounce: Debounce,
        watchdog: Watchdog,
        from_can: Consumer<'static, Frame>,
        next_heartbeat: Instant,
        answers: Consumer<'static, Frame>,
    }

    #[init(local = [network_queue: FrameQueue = Queue::new(), answer_queue: FrameQueue = Queue::new()])]
    fn init(cx: init::Context) -> (Shared, Local) {
        let board = nucleo_g474re::setup(
            cx.device,
            &Config {
                period_us: 10_000,
                deadline_us: design::TPDO_DEADLINE_US,
                watchdog_ms: design::WATCHDOG_MS,
                filters: &filters::FILTERS,
            },
        );
        defmt::info!(
            "canmaster {=str}: reset by {=str}",
            env!("CARGO_PKG_VERSION"),
            board.reset_cause.text()
        );
        let (to_network, from_can) = cx.local.network_queue.split();
        let (to_configurator, answers) = cx.local.answer_queue.split();
        let sync = defmt::unwrap!(can::Element::new(&Frame::empty(CobId::SYNC)));
        defmt::unwrap!(sdo_configurator::spawn().ok());
        (
            Shared {
                od: MasterOd::new(&LENGTHS),
                can_tx: board.can_tx,
                tx_queue: TxQueue::new(),
            },
            Local {
                period: board.period,
                sync,
                can_rx: board.can_rx,
                to_network,
                to_configurator,
                deadline: board.deadline,
                tick: board.tick,
                microseconds: board.microseconds,
                run_led: board.run_led,
                error_led: board.error_led,
                button: board.button,
                debounce: Debounce::new(design::BUTTON_SAMPLES),
                watchdog: board.watchdog,
                from_can,
                next_heartbeat: Instant::from_micros(600_000),
                answers,
            },
        )
    }

    #[idle]
    fn idle(_: idle::Context) -> ! {
        loop {
            cortex_m::asm::wfi();
        }
    }

    #[task(binds = TIM2, priority = 5, local = [period, sync], shared = [od, can_tx])]
    fn sync_tick(cx: sync_tick::Context) {
        cx.local.period.acknowledge();
        let sync = *cx.local.sync;
        (cx.shared.od, cx.shared.can_tx).lock(|od, can_tx| {
            if !od.sync_producer() {
                return;
            }
            if can_tx.holds(CobId::SYNC.into()) || can_tx.transmit(&sync).is_err() {
                counters::SYNC_NOT_SENT.count();
            }
            od.open_cycle();
        });
        roll::check_in(Task::SyncTick);
    }

    #[task(binds = FDCAN1_IT0, priority = 4, local = [can_rx, to_network, to_configurator], shared = [od, can_tx, tx_queue])]
    fn can_irq(mut cx: can_irq::Context) {
        let flags = cx.local.can_rx.take_flags();
        if flags.message_lost() {
            counters::RX_OVERRUNS.count();
        }
        loop {
            let received = cx
                .local
                .can_rx
                .receive(can::Fifo::Fifo0)
                .or_else(|| cx.local.can_rx.receive(can::Fifo::Fifo1));
            let Some(element) = received else { break };
            match filters::HANDLERS.get(usize::from(element.filter())) {
                Some(Handler::Tpdo(number)) => {
                    let node = element.identifier().map_or(0, |id| id.as_raw() & 0x7F);
                    let Some(slot) = TpdoSlot::new(usize::from(node).wrapping_sub(1), *number)
                    else {
                        continue;
                    };
                    let got = cx
                        .shared
                        .od
                        .lock(|od| od.store(slot, element.bytes(), element.len()));
                    match got {
                        Reception::Last => rtic::pend(Interrupt::TIM3),
                        Reception::WrongLength => counters::TPDO_LENGTH.count(),
                        Reception::Stored => {}
                    }
                }
                Some(Handler::Emcy | Handler::ErrorControl) => {
                    if let Some(frame) = element.frame()
                        && cx.local.to_network.enqueue(frame).is_err()
                    {
                        counters::RX_QUEUE_FULL.count();
                    }
                    rtic::pend(Interrupt::TIM7);
                }
                Some(Handler::SdoResponse) => {
                    if let Some(frame) = element.frame()
                        && cx.local.to_configurator.enqueue(frame).is_err()
                    {
                        counters::RX_QUEUE_FULL.count();
                    }
                    rtic::pend(Interrupt::TIM7);
                }
                None => {}
            }
        }
        loop {
            let pending = cx.shared.can_tx.lock(|tx| tx.pending());
            let pending = pending.into_iter().flatten().map(CobId::from);
            let Some(frame) = cx.shared.tx_queue.lock(|queue| queue.next(pending)) else {
                break;
            };
            let Some(element) = can::Element::new(&frame) else {
                continue;
            };
            if cx.shared.can_tx.lock(|tx| tx.transmit(&element)).is_err() {
                break;
            }
        }
        roll::check_in(Task::CanIrq);
    }

    #[task(binds = TIM3, priority = 3, local = [deadline], shared = [od, tx_queue])]
    fn pdo_producer(mut cx: pdo_producer::Context) {
        let deadline = cx.local.deadline.take();
        cx.shared.od.lock(|od| od.take_cycle(deadline));
        roll::check_in(Task::PdoProducer);
    }

    #[task(binds = TIM7, priority = 2, local = [tick, microseconds, run_led, error_led, button, debounce, watchdog, from_can, next_heartbeat], shared = [od, tx_queue])]
    fn network(mut cx: network::Context) {
        let counter = cx.local.microseconds.now();
        CLOCK.keep(counter);
        let now = CLOCK.now(|| counter);
        while cx.local.from_can.dequeue().is_some() {}
        WAKE.writer().write(());
        if cx.local.tick.take() {
            if cx.local.debounce.press(cx.local.button.is_pressed()) {
                cx.local.error_led.set(true);
            }
            if now >= *cx.local.next_heartbeat {
                *cx.local.next_heartbeat += Duration::from_millis(50);
                let on = (now.as_micros() / 200_000).is_multiple_of(2);
                cx.local.run_led.set(on);
                let id = CobId::of(FunctionCode::ErrorControl, NodeId::MAX);
                if let Some(frame) = Frame::data_frame(id, &[0x7F]) {
                    let _ = cx.shared.tx_queue.lock(|queue| queue.put(frame));
                }
                cx.shared.od.lock(|od| od.set_sync_producer(true));
            }
            rtic::pend(Interrupt::FDCAN1_IT0);
        }
        if roll::complete() {
            cx.local.watchdog.feed();
        }
        roll::check_in(Task::Network);
    }

    #[task(priority = 1, local = [answers])]
    async fn sdo_configurator(cx: sdo_configurator::Context) {
        let mut wake = WAKE.take_reader();
        loop {
            wake.wait().await;
            while cx.local.answers.dequeue().is_some() {}
            roll::check_in(Task::SdoConfigurator);
        }
    }
}
