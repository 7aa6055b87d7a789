//! The entries that can be written and saved.

use super::super::table::{Row, TABLE};
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

/// Settings of the board alone.
pub(super) const OWN: usize = 14;

/// Those of them that are saved, in an order in which they can be loaded: the
/// SYNC's period after what may be changed only without one.
const SAVED: [Setting; OWN - 1] = [
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

impl Setting {
    /// Where a setting of the board alone is kept.
    pub(super) const fn place(self) -> usize {
        match self {
            Setting::SyncCobId | Setting::ConsumerHeartbeat(_) | Setting::Assignment(_) => 0,
            Setting::SyncPeriod => 1,
            Setting::SyncWindow => 2,
            Setting::TimeCobId => 3,
            Setting::EmcyCobId => 4,
            Setting::EmcyInhibit => 5,
            Setting::ProducerHeartbeat => 6,
            Setting::SyncOverflow => 7,
            Setting::ConfigurationDate => 8,
            Setting::ConfigurationTime => 9,
            Setting::ErrorBehaviour => 10,
            Setting::Startup => 11,
            Setting::BootTime => 12,
            Setting::TimePeriod => 13,
        }
    }

    /// Which one it is, whatever the node.
    pub(in crate::device) const fn number(self) -> u8 {
        match self {
            Setting::SyncCobId => 0,
            Setting::SyncPeriod => 1,
            Setting::SyncWindow => 2,
            Setting::TimeCobId => 3,
            Setting::EmcyCobId => 4,
            Setting::EmcyInhibit => 5,
            Setting::ConsumerHeartbeat(_) => 6,
            Setting::ProducerHeartbeat => 7,
            Setting::SyncOverflow => 8,
            Setting::ConfigurationDate => 9,
            Setting::ConfigurationTime => 10,
            Setting::ErrorBehaviour => 11,
            Setting::Startup => 12,
            Setting::Assignment(_) => 13,
            Setting::BootTime => 14,
            Setting::TimePeriod => 15,
        }
    }

    /// The setting with this number, of this node if it is one of a node.
    pub(in crate::device) const fn numbered(number: u8, node: u8) -> Setting {
        match number {
            0 => Setting::SyncCobId,
            1 => Setting::SyncPeriod,
            2 => Setting::SyncWindow,
            3 => Setting::TimeCobId,
            4 => Setting::EmcyCobId,
            5 => Setting::EmcyInhibit,
            6 => Setting::ConsumerHeartbeat(node),
            7 => Setting::ProducerHeartbeat,
            8 => Setting::SyncOverflow,
            9 => Setting::ConfigurationDate,
            10 => Setting::ConfigurationTime,
            11 => Setting::ErrorBehaviour,
            12 => Setting::Startup,
            13 => Setting::Assignment(node),
            14 => Setting::BootTime,
            _ => Setting::TimePeriod,
        }
    }

    /// Type of the entry.
    pub fn data_type(self) -> DataType {
        self.row().map_or(DataType::Unsigned32, |row| row.data_type)
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
        let row = self.row()?;
        let sub = match self {
            Setting::ConsumerHeartbeat(n) => n + 1,
            Setting::Assignment(n) => network.nodes.get(usize::from(n))?.id.get(),
            _ => row.sub,
        };
        Some(Address::new(row.first, sub))
    }

    /// Its line in the list of objects.
    fn row(self) -> Option<&'static Row> {
        TABLE.iter().find(|row| row.is_of(self))
    }

    /// Those that are saved, in an order in which they can be loaded.
    pub fn saved(nodes: u8) -> impl Iterator<Item = Setting> {
        (0..).map_while(move |n| Setting::nth_saved(n, nodes))
    }

    fn nth_saved(n: u8, nodes: u8) -> Option<Setting> {
        let Some(n) = usize::from(n).checked_sub(SAVED.len()) else {
            return SAVED.get(usize::from(n)).copied();
        };
        let n = n as u8;
        if n < nodes {
            return Some(Setting::ConsumerHeartbeat(n));
        }
        let n = n - nodes;
        (n < nodes).then_some(Setting::Assignment(n))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::sample::SIX_EPOS4;

    #[test]
    fn every_setting_has_its_number_and_its_row() {
        for number in 0..16 {
            let setting = Setting::numbered(number, 3);
            assert_eq!(setting.number(), number);
            assert!(setting.address(&SIX_EPOS4).is_some(), "{setting:?}");
        }
        assert_eq!(Setting::numbered(6, 3), Setting::ConsumerHeartbeat(3));
        assert_eq!(Setting::numbered(13, 3), Setting::Assignment(3));
    }
}
