//! What a client may change and 1010h saves.

mod setting;
mod stored;

pub use setting::Setting;

use crate::boot::{self, Assignment, Startup};
use crate::emcy::EmcyCobId;
use crate::id::NodeId;
use crate::network::Network;
use crate::nmt::ErrorBehaviour;
use crate::sdo::AbortCode;
use crate::sync::{SyncCobId, SyncLimits, SyncParameters};
use crate::time::Duration;
use crate::time_of_day::TimeCobId;

/// The settings of a master of at most `N` nodes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Settings<const N: usize> {
    sync: SyncParameters,
    time_cob_id: TimeCobId,
    time_period_ms: u16,
    emcy_cob_id: EmcyCobId,
    emcy_inhibit: u16,
    heartbeat_ms: u16,
    consumers: [u32; N],
    error_behaviour: ErrorBehaviour,
    startup: Startup,
    assignments: [Assignment; N],
    boot_time_ms: u32,
    configured: [u32; 2],
}

/// 1F8Ah: what a node is told to restore before it is configured: 1011h:01, all
/// parameters.
pub(super) const RESTORE_ALL: u8 = 1;
/// How often TIME is sent unless told otherwise.
const TIME_PERIOD_MS: u16 = 1000;
/// A consumer heartbeat time: node in bits 23..16, milliseconds in bits 15..0.
const CONSUMER_NODE: u32 = 16;
const CONSUMER_MS: u32 = 0xFFFF;
/// Consumer heartbeat time of the master in percent of the node's producer time.
const CONSUMER_PERCENT: u32 = 250;
const HUNDRED: u32 = 100;

impl<const N: usize> Settings<N> {
    /// As the network's design has them.
    pub fn new(network: &Network) -> Settings<N> {
        let mut settings = Settings {
            sync: SyncParameters::new(network.cycle.as_micros()),
            time_cob_id: TimeCobId::DEFAULT,
            time_period_ms: TIME_PERIOD_MS,
            emcy_cob_id: EmcyCobId::predefined(network.master.node),
            emcy_inhibit: 0,
            heartbeat_ms: network.master.heartbeat.as_millis() as u16,
            consumers: [0; N],
            // A lost node does not take the master down.
            error_behaviour: ErrorBehaviour::NoChange,
            startup: Startup(Startup::MASTER | Startup::START_ALL),
            assignments: [Assignment(0); N],
            boot_time_ms: network.master.boot_time.as_millis(),
            configured: [0; 2],
        };
        for (node, (consumer, assignment)) in network
            .nodes
            .iter()
            .zip(settings.consumers.iter_mut().zip(&mut settings.assignments))
        {
            let ms = u32::from(node.heartbeat_ms) * CONSUMER_PERCENT / HUNDRED;
            let ms = ms.min(CONSUMER_MS);
            *consumer = if ms == 0 {
                0
            } else {
                u32::from(node.id.get()) << CONSUMER_NODE | ms
            };
            let mandatory = if node.mandatory {
                Assignment::MANDATORY
            } else {
                0
            };
            *assignment = Assignment(Assignment::LISTED | Assignment::MAY_START | mandatory);
        }
        settings
    }

    /// 1005h, 1006h, 1007h, 1019h.
    pub const fn sync(&self) -> &SyncParameters {
        &self.sync
    }

    /// Sets or clears bit 30 of 1005h from within the device.
    pub(super) fn set_sync_producer(&mut self, on: bool) {
        let cob_id = self.sync.cob_id().producer(on);
        // The identifier stays, so it is not refused.
        let _ = self.sync.set_cob_id(cob_id);
    }

    /// 1012h.
    pub const fn time_cob_id(&self) -> TimeCobId {
        self.time_cob_id
    }

    /// 2F11h.
    pub const fn time_period(&self) -> Duration {
        Duration::from_millis(self.time_period_ms as u32)
    }

    /// 1014h.
    pub const fn emcy_cob_id(&self) -> EmcyCobId {
        self.emcy_cob_id
    }

    /// 1015h, in units of 100 us.
    pub const fn emcy_inhibit(&self) -> u16 {
        self.emcy_inhibit
    }

    /// 1017h.
    pub const fn heartbeat(&self) -> Duration {
        Duration::from_millis(self.heartbeat_ms as u32)
    }

    /// 1016h: who is watched, and how long its heartbeat may stay away.
    pub fn consumers(&self) -> impl Iterator<Item = (NodeId, Duration)> {
        self.consumers.iter().filter_map(|entry| consumer(*entry))
    }

    /// The consumer heartbeat time for a node; `None` if it is not watched.
    pub fn consumer_time(&self, node: NodeId) -> Option<Duration> {
        self.consumers()
            .find(|(watched, _)| *watched == node)
            .map(|(_, time)| time)
    }

    /// 1029h:01.
    pub const fn error_behaviour(&self) -> ErrorBehaviour {
        self.error_behaviour
    }

    /// 1F80h.
    pub const fn startup(&self) -> Startup {
        self.startup
    }

    /// 1F81h of the node with this place in the network.
    pub fn assignment(&self, place: usize) -> Option<Assignment> {
        self.assignments.get(place).copied()
    }

    /// 1F89h; zero: for ever.
    pub const fn boot_time(&self) -> Duration {
        Duration::from_millis(self.boot_time_ms)
    }

    /// What the boot-up of the network goes by: 1F80h, 1F81h, 1F89h; 1F8Ah as it
    /// is in this dictionary.
    pub fn boot(&self) -> boot::Settings<N> {
        boot::Settings {
            startup: self.startup,
            boot_time: self.boot_time(),
            nodes: self.assignments.map(|assignment| boot::NodeSettings {
                assignment,
                restore: RESTORE_ALL,
            }),
        }
    }

    /// The value of an entry.
    pub fn get(&self, setting: Setting) -> u32 {
        match setting {
            Setting::SyncCobId => self.sync.cob_id().0,
            Setting::SyncPeriod => self.sync.period(),
            Setting::SyncWindow => self.sync.window(),
            Setting::SyncOverflow => u32::from(self.sync.overflow()),
            Setting::TimeCobId => self.time_cob_id.0,
            Setting::TimePeriod => u32::from(self.time_period_ms),
            Setting::EmcyCobId => self.emcy_cob_id.0,
            Setting::EmcyInhibit => u32::from(self.emcy_inhibit),
            Setting::ConsumerHeartbeat(n) => element(&self.consumers, n),
            Setting::ProducerHeartbeat => u32::from(self.heartbeat_ms),
            Setting::ConfigurationDate => element(&self.configured, 0),
            Setting::ConfigurationTime => element(&self.configured, 1),
            Setting::ErrorBehaviour => u32::from(self.error_behaviour.code()),
            Setting::Startup => self.startup.0,
            Setting::Assignment(n) => self
                .assignments
                .get(usize::from(n))
                .map_or(0, |assignment| assignment.0),
            Setting::BootTime => self.boot_time_ms,
        }
    }

    /// Writes an entry. A change of any other entry takes date and time of the
    /// configuration (1020h) back to 0 (CiA 301, 7.5.2.23).
    ///
    /// # Errors
    /// What the entry has to say to this value.
    pub(super) fn set(
        &mut self,
        setting: Setting,
        value: u32,
        limits: &SyncLimits,
    ) -> Result<(), AbortCode> {
        let before = self.get(setting);
        self.put(setting, value, limits)?;
        let is_signature = matches!(
            setting,
            Setting::ConfigurationDate | Setting::ConfigurationTime
        );
        if !is_signature && self.get(setting) != before {
            self.configured = [0; 2];
        }
        Ok(())
    }

    fn put(&mut self, setting: Setting, value: u32, limits: &SyncLimits) -> Result<(), AbortCode> {
        match setting {
            Setting::SyncCobId => return self.sync.set_cob_id(SyncCobId(value)),
            Setting::SyncPeriod => return self.sync.set_period(value, limits),
            Setting::SyncWindow => return self.sync.set_window(value, limits),
            Setting::SyncOverflow => {
                let overflow = u8::try_from(value).map_err(|_| AbortCode::VALUE_RANGE)?;
                return self.sync.set_overflow(overflow);
            }
            Setting::TimeCobId => {
                TimeCobId(value).may_replace(self.time_cob_id)?;
                self.time_cob_id = TimeCobId(value);
            }
            Setting::TimePeriod => self.time_period_ms = value as u16,
            Setting::EmcyCobId => {
                EmcyCobId(value).may_replace(self.emcy_cob_id)?;
                self.emcy_cob_id = EmcyCobId(value);
            }
            Setting::EmcyInhibit => self.emcy_inhibit = value as u16,
            Setting::ConsumerHeartbeat(n) => self.set_consumer(usize::from(n), value)?,
            Setting::ProducerHeartbeat => self.heartbeat_ms = value as u16,
            Setting::ConfigurationDate => put_element(&mut self.configured, 0, value)?,
            Setting::ConfigurationTime => put_element(&mut self.configured, 1, value)?,
            Setting::ErrorBehaviour => {
                let code = u8::try_from(value).map_err(|_| AbortCode::VALUE_RANGE)?;
                self.error_behaviour =
                    ErrorBehaviour::from_code(code).ok_or(AbortCode::VALUE_RANGE)?;
            }
            Setting::Startup => {
                self.startup = Startup::new(value)?;
            }
            Setting::Assignment(n) => {
                let assignment = Assignment::new(value)?;
                put_element(&mut self.assignments, usize::from(n), assignment)?;
            }
            Setting::BootTime => {
                if Duration::from_millis(value) == Duration::MAX {
                    return Err(AbortCode::VALUE_TOO_HIGH);
                }
                self.boot_time_ms = value;
            }
        }
        Ok(())
    }

    /// No node is watched by two entries (CiA 301, 7.5.2.19).
    fn set_consumer(&mut self, n: usize, value: u32) -> Result<(), AbortCode> {
        if value >> CONSUMER_NODE > u32::from(u8::MAX) {
            return Err(AbortCode::VALUE_RANGE);
        }
        let taken = |(other, entry): (usize, &u32)| {
            let (Some((a, _)), Some((b, _))) = (consumer(*entry), consumer(value)) else {
                return false;
            };
            other != n && a == b
        };
        if self.consumers.iter().enumerate().any(taken) {
            return Err(AbortCode::PARAMETER_INCOMPATIBLE);
        }
        put_element(&mut self.consumers, n, value)
    }
}

/// How many nodes there is room for.
pub(super) fn nodes<const N: usize>(network: &Network) -> u8 {
    network
        .nodes
        .len()
        .min(N)
        .min(usize::from(NodeId::MAX.get())) as u8
}

/// Node and time of an entry of 1016h; `None` if the entry is not used.
fn consumer(entry: u32) -> Option<(NodeId, Duration)> {
    let node = NodeId::new((entry >> CONSUMER_NODE) as u8)?;
    let ms = entry & CONSUMER_MS;
    (ms != 0).then(|| (node, Duration::from_millis(ms)))
}

fn element(from: &[u32], n: u8) -> u32 {
    from.get(usize::from(n)).copied().unwrap_or_default()
}

fn put_element<T>(into: &mut [T], n: usize, value: T) -> Result<(), AbortCode> {
    *into.get_mut(n).ok_or(AbortCode::NO_SUCH_SUB_INDEX)? = value;
    Ok(())
}
