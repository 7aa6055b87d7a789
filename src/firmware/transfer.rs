//! 2F12h: moves test data between the board and a node, as fast as it goes.
//!
//! The answers of that node come past the configurator meanwhile, so that it
//! hears nothing from it. A node that boots again under the test is silent for
//! the configurator until the test has failed, which it does within its timeout.

use crate::{app::app::sdo_transfer, wake::TRANSFER};
use canmaster::{
    Frame, NodeId,
    design::{self, TX_QUEUE},
    device::{TransferResult, TransferTest},
    id::CobId,
    master::{ExtendedClock, TxQueue},
    sdo::{AbortCode, AsyncClient, Channel, Link, TestData},
    time::{Duration, Instant},
};
use core::sync::atomic::{AtomicU16, AtomicU32, Ordering::Relaxed};
use heapless::spsc::Consumer;
use nucleo_g474re::{pac::Interrupt, timers::Microseconds};
use rtic::Mutex;
use rtic_sync::signal::SignalReader;

/// How long the node may take for an answer; and after a failure everything that
/// it may still have to say is waited for as long.
const TIMEOUT: Duration = Duration::from_millis(100);

/// The identifier of the answers that are the test's; 0: none.
static ANSWERS: AtomicU16 = AtomicU16::new(0);
static BYTES: AtomicU32 = AtomicU32::new(0);
static MICROSECONDS: AtomicU32 = AtomicU32::new(0);
static CODE: AtomicU32 = AtomicU32::new(TransferResult::NONE.code);

/// Whether the test wants the answers with this identifier.
#[inline(always)]
pub(crate) fn wants(id: CobId) -> bool {
    id.get() == ANSWERS.load(Relaxed)
}

/// Lets time pass: to be called every millisecond.
pub(crate) fn tick(now_us: u32) {
    if ANSWERS.load(Relaxed) != 0 {
        TRANSFER.if_due(now_us);
    }
}

/// Starts a test, unless one is under way.
pub(crate) fn start(test: TransferTest) -> Result<(), AbortCode> {
    sdo_transfer::spawn(test).map_err(|_| AbortCode::DEVICE_STATE)?;
    publish(0, 0, TransferResult::UNDER_WAY);
    Ok(())
}

/// What the last one came to.
pub(crate) fn result() -> TransferResult {
    TransferResult {
        bytes: BYTES.load(Relaxed),
        us: MICROSECONDS.load(Relaxed),
        code: CODE.load(Relaxed),
    }
}

fn publish(bytes: u32, us: u32, code: u32) {
    BYTES.store(bytes, Relaxed);
    MICROSECONDS.store(us, Relaxed);
    CODE.store(code, Relaxed);
}

/// The bus and the clock as the test has them.
pub(crate) struct Bus<'a, T> {
    pub(crate) answers: &'a mut Consumer<'static, Frame>,
    pub(crate) clock: &'static ExtendedClock,
    pub(crate) counter: Microseconds,
    pub(crate) tx_queue: T,
    pub(crate) wake: SignalReader<'static, ()>,
}

impl<T: Mutex<T = TxQueue<TX_QUEUE>>> Link for Bus<'_, T> {
    fn now(&self) -> Instant {
        self.clock.now(|| self.counter.now())
    }

    fn send(&mut self, frame: Frame) -> bool {
        let sent = self
            .tx_queue
            .lock(|queue| queue.len() < design::OWN_FRAMES && queue.put(frame).is_ok());
        rtic::pend(Interrupt::FDCAN1_IT0);
        sent
    }

    fn receive(&mut self) -> Option<Frame> {
        self.answers.dequeue()
    }

    /// Where there was no room, the queue is looked at again in the next
    /// millisecond: it does not run empty before.
    async fn wait(&mut self, until: Instant) {
        TRANSFER.at(until.as_micros() as u32);
        self.wake.wait().await;
    }
}

/// Makes one test.
pub(crate) async fn run<T: Mutex<T = TxQueue<TX_QUEUE>>>(test: TransferTest, mut bus: Bus<'_, T>) {
    // It was checked.
    let node = test.node().unwrap_or(NodeId::MAX);
    let mut channel = Channel::new(node, TIMEOUT);
    ANSWERS.store(channel.response_id().get(), Relaxed);
    let begun = bus.counter.now();
    let mut data = TestData::new(test.seed);
    let size = (!test.is_upload()).then_some(test.size);
    let done = AsyncClient::new(&mut channel, &mut bus)
        .transfer(test.at(), size, test.protocol(), &mut data)
        .await;
    let us = bus.counter.now().wrapping_sub(begun);
    let code = match done {
        Ok(transfer) if transfer.len == test.size => 0,
        Ok(_) => AbortCode::LENGTH_MISMATCH.0,
        Err(error) => error.code().0,
    };
    ANSWERS.store(0, Relaxed);
    publish(data.reached(), us, code);
}
