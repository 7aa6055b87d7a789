//! What `network` has to know of heartbeats: `sdo_configurator` gives it as the
//! settings say it, and `network` takes it without a lock. If it does so while that is
//! being written, it does so once more.

use crate::{app::app::NETWORK, asking, derived::AXES};
use canmaster::{
    NodeId,
    device::{Setting, Settings},
    master::Supervisor,
    time::Duration,
};
use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering::Relaxed};

/// 1017h, in microseconds.
static PRODUCER_US: AtomicU32 = AtomicU32::new(0);
/// 1016h, in microseconds; zero: not watched.
static CONSUMERS_US: [AtomicU32; AXES] = [const { AtomicU32::new(0) }; AXES];
/// 1016h: a node that the network does not name; zero: none.
static OTHER: AtomicU8 = AtomicU8::new(0);
static OTHER_US: AtomicU32 = AtomicU32::new(0);
/// 1016h was written.
static CHANGED: AtomicBool = AtomicBool::new(false);

/// Takes over a setting, if it is one of these.
pub(crate) fn give(setting: Setting, settings: &Settings<AXES>) {
    match setting {
        Setting::ProducerHeartbeat => {
            PRODUCER_US.store(settings.heartbeat().as_micros(), Relaxed);
        }
        Setting::ConsumerHeartbeat(_) => {
            OTHER.store(0, Relaxed);
            for time in &CONSUMERS_US {
                time.store(0, Relaxed);
            }
            for (node, time) in settings.consumers() {
                let time = time.as_micros();
                match NETWORK.find(node) {
                    // One more at most is watched.
                    None if OTHER.load(Relaxed) == 0 => {
                        OTHER_US.store(time, Relaxed);
                        OTHER.store(node.get(), Relaxed);
                    }
                    Some((axis, _)) if asking::is_watched(axis) => {
                        if let Some(place) = CONSUMERS_US.get(axis) {
                            place.store(time, Relaxed);
                        }
                    }
                    _ => {}
                }
            }
            CHANGED.store(true, Relaxed);
        }
        _ => {}
    }
}

/// The producer heartbeat time of the board.
pub(crate) fn producer() -> Duration {
    Duration::from_micros(PRODUCER_US.load(Relaxed))
}

/// Tells the supervisor whom to watch, if that has changed.
pub(crate) fn watch(supervisor: &mut Supervisor<AXES>) {
    if !CHANGED.load(Relaxed) {
        return;
    }
    CHANGED.store(false, Relaxed);
    for (node, time) in NETWORK.nodes.iter().zip(&CONSUMERS_US) {
        supervisor.set_consumer_time(node.id, Duration::from_micros(time.load(Relaxed)));
    }
    let other = NodeId::new(OTHER.load(Relaxed));
    supervisor.watch(other.map(|node| (node, Duration::from_micros(OTHER_US.load(Relaxed)))));
}
