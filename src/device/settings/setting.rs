//! The entries that can be written and saved.

use super::super::index;
use crate::id::Address;
use crate::network::Network;
use crate::od::DataType;

/// An entry that can be written and saved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Setting {
    /// 1005h. Not saved: the boot-up of the network switches the SYNC on.
    SyncCobId,
    /// 1006h
    SyncPeriod,
    /// 1007h
    SyncWindow,
    /// 1012h
    TimeCobId,
    /// 1014h
    EmcyCobId,
    /// 1015h
    EmcyInhibit,
    /// 1016h, counted from 0
    ConsumerHeartbeat(u8),
    /// 1017h
    ProducerHeartbeat,
    /// 1019h
    SyncOverflow,
    /// 1020h:01
    ConfigurationDate,
    /// 1020h:02
    ConfigurationTime,
    /// 1029h:01
    ErrorBehaviour,
    /// 1F80h
    Startup,
    /// 1F81h of the node with this place in the network
    Assignment(u8),
    /// 1F89h
    BootTime,
    /// 2F11h
    TimePeriod,
}

impl Setting {
    /// Type of the entry.
    pub const fn data_type(self) -> DataType {
        match self {
            Setting::SyncOverflow | Setting::ErrorBehaviour => DataType::Unsigned8,
            Setting::EmcyInhibit | Setting::ProducerHeartbeat | Setting::TimePeriod => {
                DataType::Unsigned16
            }
            _ => DataType::Unsigned32,
        }
    }

    /// Whether it can be written in pre-operational only: the SYNC is the beat
    /// that everything else keeps to.
    pub const fn needs_pre_operational(self) -> bool {
        matches!(
            self,
            Setting::SyncCobId | Setting::SyncPeriod | Setting::SyncWindow | Setting::SyncOverflow
        )
    }

    /// The entry; `None` if the network has no such node.
    pub fn address(self, network: &Network) -> Option<Address> {
        let (at, sub) = match self {
            Setting::SyncCobId => (index::COB_ID_SYNC, 0),
            Setting::SyncPeriod => (index::SYNC_PERIOD, 0),
            Setting::SyncWindow => (index::SYNC_WINDOW, 0),
            Setting::TimeCobId => (index::COB_ID_TIME, 0),
            Setting::EmcyCobId => (index::COB_ID_EMCY, 0),
            Setting::EmcyInhibit => (index::EMCY_INHIBIT, 0),
            Setting::ConsumerHeartbeat(n) => (index::CONSUMER_HEARTBEAT, n + 1),
            Setting::ProducerHeartbeat => (index::PRODUCER_HEARTBEAT, 0),
            Setting::SyncOverflow => (index::SYNC_OVERFLOW, 0),
            Setting::ConfigurationDate => (index::VERIFY_CONFIGURATION, 1),
            Setting::ConfigurationTime => (index::VERIFY_CONFIGURATION, 2),
            Setting::ErrorBehaviour => (index::ERROR_BEHAVIOUR, 1),
            Setting::Startup => (index::NMT_STARTUP, 0),
            Setting::Assignment(n) => {
                let node = network.nodes.get(usize::from(n))?;
                (index::SLAVE_ASSIGNMENT, node.id.get())
            }
            Setting::BootTime => (index::BOOT_TIME, 0),
            Setting::TimePeriod => (index::TIME_PERIOD, 0),
        };
        Some(Address::new(at, sub))
    }

    /// Those that are saved, in an order in which they can be loaded: the SYNC's
    /// period after what may be changed only without one.
    pub fn saved(nodes: u8) -> impl Iterator<Item = Setting> {
        let fixed = [
            Setting::SyncOverflow,
            Setting::SyncWindow,
            Setting::SyncPeriod,
            Setting::TimeCobId,
            Setting::TimePeriod,
            Setting::EmcyCobId,
            Setting::EmcyInhibit,
            Setting::ProducerHeartbeat,
            Setting::ErrorBehaviour,
            Setting::Startup,
            Setting::BootTime,
            Setting::ConfigurationDate,
            Setting::ConfigurationTime,
        ];
        fixed
            .into_iter()
            .chain((0..nodes).map(Setting::ConsumerHeartbeat))
            .chain((0..nodes).map(Setting::Assignment))
    }
}
