//! The EDS of the drive and the simulated drive were written from the same facts:
//! here each holds the other to them.

use canmaster::od::{Access, Mappable};
use canmaster_network::eds::Eds;
use canmaster_network::object::{Address, DataType, Direction};
use canmaster_network::{Source, object};
use canmaster_sim::drive::objects::{GUARD_TIME, LIFE_TIME_FACTOR, TABLE};
use canmaster_sim::drive::test_data;

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../eds/maxon-epos4.eds");

fn eds() -> Eds {
    let bytes = std::fs::read(FILE).unwrap();
    Eds::read(&Source::new("maxon-epos4.eds", &bytes)).0
}

#[test]
fn every_object_of_the_simulated_drive_is_in_the_eds_as_it_is() {
    let eds = eds();
    for object in TABLE.objects() {
        let at = Address::new(object.at.index.0, object.at.sub.0);
        // Only where a drive is said to have them, and that is not this one.
        if [GUARD_TIME, LIFE_TIME_FACTOR, test_data::INDEX].contains(&at.index) {
            continue;
        }
        let entry = eds
            .entry(at)
            .unwrap_or_else(|| panic!("{at} is not in the EDS"));
        assert_eq!(
            entry.data_type,
            DataType::from_code(object.entry.data_type.code()),
            "{at}"
        );
        assert_eq!(
            entry.access.is_writable(),
            matches!(object.entry.access, Access::ReadWrite | Access::WriteOnly),
            "{at}"
        );
        // Where the EDS lets it be mapped, the drive takes it.
        let allows = |direction| entry.mappable && entry.access.allows(direction);
        let takes = |one| [one, Mappable::Both].contains(&object.entry.mappable);
        assert!(!allows(Direction::Receive) || takes(Mappable::Rpdo), "{at}");
        assert!(
            !allows(Direction::Transmit) || takes(Mappable::Tpdo),
            "{at}"
        );
        assert_eq!(
            entry.mappable,
            object.entry.mappable != Mappable::No,
            "{at}"
        );
        let limit = |number: Option<canmaster_network::eds::Number>| {
            number.map(|number| number.of_type(entry.data_type, 1))
        };
        if let Some((low, high)) = object.entry.range {
            assert_eq!(limit(entry.low), Some(low.into()), "{at}");
            assert_eq!(limit(entry.high), Some(high.into()), "{at}");
        }
    }
}

#[test]
fn every_entry_of_the_eds_is_in_the_simulated_drive() {
    for (at, ..) in eds().entries() {
        let found = TABLE
            .objects()
            .iter()
            .any(|object| object::Address::new(object.at.index.0, object.at.sub.0) == at);
        assert!(found, "{at} is not in the drive");
    }
}
