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
    /// Of the board alone, by [`Setting::place`].
    own: [u32; setting::OWN],
    /// 1016h
    consumers: [u32; N],
    /// 1F81h
    assignments: [u32; N],
}

/// 1F8Ah: what a node is told to restore before it is configured: 1011h:01, all
/// parameters.
pub(super) const RESTORE_ALL: u8 = 1;
/// How often TIME is sent unless told otherwise.
const TIME_PERIOD_MS: u32 = 1000;
/// A consumer heartbeat time: node in bits 23..16, milliseconds in bits 15..0.
const CONSUMER_NODE: u32 = 16;
const CONSUMER_MS: u32 = 0xFFFF;
/// Consumer heartbeat time of the master in percent of the node's producer time.
const CONSUMER_PERCENT: u32 = 250;
const HUNDRED: u32 = 100;

/// What does not depend on the network.
#[expect(
    clippy::indexing_slicing,
    reason = "a wrong place does not compile: this is a constant"
)]
const DESIGN: [u32; setting::OWN] = {
    let mut own = [0; setting::OWN];
    own[Setting::SyncCobId.place()] = SyncCobId::DEFAULT.0;
    own[Setting::TimeCobId.place()] = TimeCobId::DEFAULT.0;
    own[Setting::TimePeriod.place()] = TIME_PERIOD_MS;
    // A lost node does not take the master down.
    own[Setting::ErrorBehaviour.place()] = ErrorBehaviour::NoChange.code() as u32;
    own[Setting::Startup.place()] = Startup::MASTER | Startup::START_ALL;
    own
};

impl<const N: usize> Settings<N> {
    /// As the network's design has them.
    pub fn new(network: &Network) -> Settings<N> {
        let mut settings = Settings {
            own: DESIGN,
            consumers: [0; N],
            assignments: [0; N],
        };
        let master = &network.master;
        let emcy = EmcyCobId::predefined(master.node);
        settings.store(Setting::SyncPeriod, network.cycle.as_micros());
        settings.store(Setting::EmcyCobId, emcy.0);
        settings.store(Setting::ProducerHeartbeat, master.heartbeat.as_millis());
        settings.store(Setting::BootTime, master.boot_time.as_millis());
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
            *assignment = Assignment::LISTED | Assignment::MAY_START | mandatory;
        }
        settings
    }

    /// 1005h, 1006h, 1007h, 1019h.
    pub fn sync(&self) -> SyncParameters {
        SyncParameters::of(
            SyncCobId(self.get(Setting::SyncCobId)),
            self.get(Setting::SyncPeriod),
            self.get(Setting::SyncWindow),
            self.get(Setting::SyncOverflow) as u8,
        )
    }

    /// Sets or clears bit 30 of 1005h from within the device.
    pub(super) fn set_sync_producer(&mut self, on: bool) {
        let cob_id = SyncCobId(self.get(Setting::SyncCobId)).producer(on);
        self.store(Setting::SyncCobId, cob_id.0);
    }

    /// 1012h.
    #[inline(never)]
    pub fn time_cob_id(&self) -> TimeCobId {
        TimeCobId(self.get(Setting::TimeCobId))
    }

    /// 2F11h.
    pub fn time_period(&self) -> Duration {
        Duration::from_millis(self.get(Setting::TimePeriod))
    }

    /// 1014h.
    pub fn emcy_cob_id(&self) -> EmcyCobId {
        EmcyCobId(self.get(Setting::EmcyCobId))
    }

    /// 1015h, in units of 100 us.
    pub fn emcy_inhibit(&self) -> u16 {
        self.get(Setting::EmcyInhibit) as u16
    }

    /// 1017h.
    pub fn heartbeat(&self) -> Duration {
        Duration::from_millis(self.get(Setting::ProducerHeartbeat))
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
    pub fn error_behaviour(&self) -> ErrorBehaviour {
        let code = self.get(Setting::ErrorBehaviour) as u8;
        ErrorBehaviour::from_code(code).unwrap_or_default()
    }

    /// 1F80h.
    pub fn startup(&self) -> Startup {
        Startup(self.get(Setting::Startup))
    }

    /// 1F81h of the node with this place in the network.
    pub fn assignment(&self, place: usize) -> Option<Assignment> {
        self.assignments.get(place).copied().map(Assignment)
    }

    /// 1F89h; zero: for ever.
    pub fn boot_time(&self) -> Duration {
        Duration::from_millis(self.get(Setting::BootTime))
    }

    /// What the boot-up of the network goes by: 1F80h, 1F81h, 1F89h; 1F8Ah as it
    /// is in this dictionary.
    pub fn boot(&self) -> boot::Settings<N> {
        boot::Settings {
            startup: self.startup(),
            boot_time: self.boot_time(),
            nodes: self.assignments.map(|assignment| boot::NodeSettings {
                assignment: Assignment(assignment),
                restore: RESTORE_ALL,
            }),
        }
    }

    /// The value of an entry.
    pub fn get(&self, setting: Setting) -> u32 {
        let slot = match setting {
            Setting::ConsumerHeartbeat(n) => self.consumers.get(usize::from(n)),
            Setting::Assignment(n) => self.assignments.get(usize::from(n)),
            own => self.own.get(own.place()),
        };
        slot.copied().unwrap_or_default()
    }

    fn slot(&mut self, setting: Setting) -> Option<&mut u32> {
        match setting {
            Setting::ConsumerHeartbeat(n) => self.consumers.get_mut(usize::from(n)),
            Setting::Assignment(n) => self.assignments.get_mut(usize::from(n)),
            own => self.own.get_mut(own.place()),
        }
    }

    /// Takes over a value that is known to be right.
    fn store(&mut self, setting: Setting, value: u32) {
        if let Some(slot) = self.slot(setting) {
            *slot = value;
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
        if !is_signature && value != before {
            self.store(Setting::ConfigurationDate, 0);
            self.store(Setting::ConfigurationTime, 0);
        }
        Ok(())
    }

    fn put(&mut self, setting: Setting, value: u32, limits: &SyncLimits) -> Result<(), AbortCode> {
        let mut sync = self.sync();
        match setting {
            Setting::SyncCobId => sync.set_cob_id(SyncCobId(value)),
            Setting::SyncPeriod => sync.set_period(value, limits),
            Setting::SyncWindow => sync.set_window(value, limits),
            Setting::SyncOverflow => sync.set_overflow(value),
            Setting::TimeCobId => TimeCobId(value).may_replace(self.time_cob_id()),
            Setting::EmcyCobId => EmcyCobId(value).may_replace(self.emcy_cob_id()),
            Setting::ConsumerHeartbeat(n) => self.consumer_fits(usize::from(n), value),
            Setting::Startup => Startup::new(value).map(|_| ()),
            Setting::Assignment(_) => Assignment::new(value).map(|_| ()),
            Setting::BootTime if Duration::from_millis(value) == Duration::MAX => {
                Err(AbortCode::VALUE_TOO_HIGH)
            }
            Setting::ErrorBehaviour if value > u32::from(ErrorBehaviour::MAX) => {
                Err(AbortCode::VALUE_RANGE)
            }
            Setting::TimePeriod | Setting::EmcyInhibit | Setting::ProducerHeartbeat
                if value > u32::from(u16::MAX) =>
            {
                Err(AbortCode::VALUE_RANGE)
            }
            _ => Ok(()),
        }?;
        *self.slot(setting).ok_or(AbortCode::NO_SUCH_SUB_INDEX)? = value;
        Ok(())
    }

    /// No node is watched by two entries (CiA 301, 7.5.2.19).
    fn consumer_fits(&self, n: usize, value: u32) -> Result<(), AbortCode> {
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
        Ok(())
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
