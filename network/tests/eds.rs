//! The oddities of real files.

use canmaster_network::eds::{Eds, ObjectKind};
use canmaster_network::object::{Access, Address, DataType};
use canmaster_network::{Problem, Source};

fn eds(text: &str) -> (Eds, Vec<Problem>) {
    Eds::read(&Source::new("device.eds", text.as_bytes()))
}

const fn at(index: u16, sub: u8) -> Address {
    Address::new(index, sub)
}

#[test]
fn compact_sub_objects() {
    let (eds, problems) = eds("[1016]\n\
        ParameterName=Consumer heartbeat time\n\
        ObjectType=8\nDataType=0x0007\nAccessType=rw\nDefaultValue=0\nCompactSubObj=3\n\
        [1016Name]\nNrOfEntries=1\n2=Of the master\n\
        [1016Value]\nNrOfEntries=1\n3=0x007F0064\n");
    assert!(problems.is_empty(), "{problems:?}");
    let object = &eds.objects[&0x1016];
    assert_eq!(object.kind, ObjectKind::Array);
    assert_eq!(object.entries.len(), 4);
    let sub_0 = &object.entries[&0];
    assert_eq!(
        (sub_0.data_type, sub_0.access),
        (DataType::Unsigned(8), Access::ReadOnly)
    );
    assert_eq!(sub_0.default.unwrap().value, 3);
    assert_eq!(object.entries[&1].name, "Consumer heartbeat time1");
    assert_eq!(object.entries[&2].name, "Of the master");
    assert_eq!(object.entries[&3].data_type, DataType::Unsigned(32));
    assert_eq!(object.entries[&3].parameter.unwrap().value, 0x007F_0064);
    assert!(object.entries[&1].parameter.is_none());
}

#[test]
fn case_line_ends_blanks_and_comments() {
    let text = "\u{FEFF}[fileinfo]\r\n; a comment\r\n\r\n[DEVICEINFO]\r\nvendornumber = 0XFB ; maxon\r\n\
        BAUDRATE_1000=1\r\nBaudRate_10=0\r\nLSS_Supported=1\r\n\
        [1A00SUB0A]\r\nParameterName=Tenth\r\ndatatype=7\r\naccesstype=RW\r\n\
        [1a00]\r\nobjecttype=0X9\r\nparametername=Mapping\r\n\
        [1800Sub1]\r\nParameterName=COB-ID\r\nDataType=0x7\r\nAccessType=rw\r\n\
        DefaultValue=$NodeID + 0x40000180\r\n[1800]\r\nParameterName=TPDO\r\n";
    let (eds, problems) = eds(text);
    assert!(problems.is_empty(), "{problems:?}");
    assert_eq!(eds.device.vendor, Some(0xFB));
    assert!(eds.device.lss);
    assert_eq!(
        eds.device.bit_rates.into_iter().collect::<Vec<_>>(),
        [(10, false), (1000, true)]
    );
    let tenth = &eds.objects[&0x1A00].entries[&10];
    assert_eq!(
        (tenth.name.as_str(), tenth.access),
        ("Tenth", Access::ReadWrite)
    );
    let cob_id = &eds.objects[&0x1800].entries[&1];
    assert_eq!(cob_id.default.unwrap().with_node_id(5), 0x4000_0185);
    // Without ObjectType, sub-indices make it a record.
    assert_eq!(eds.objects[&0x1800].kind, ObjectKind::Record);
    assert_eq!(cob_id.line, 16);
}

#[test]
fn a_dcf_has_values_and_a_node() {
    let (dcf, problems) = eds("[DeviceComissioning]\nNodeID=0x05\nBaudrate=1000\n\
        [6065]\nParameterName=Following error window\nDataType=7\nAccessType=rww\n\
        DefaultValue=2000\nParameterValue=500\nPDOMapping=1\n\
        [6098]\nParameterName=Homing method\nDataType=2\nAccessType=rw\nParameterValue=0xFD\n");
    assert!(problems.is_empty(), "{problems:?}");
    assert_eq!(dcf.node_id, Some(5));
    let window = dcf
        .entries()
        .find(|(address, ..)| *address == at(0x6065, 0))
        .unwrap()
        .2;
    assert_eq!(window.parameter.unwrap().value, 500);
    let method = &dcf.objects[&0x6098].entries[&0];
    assert_eq!(method.parameter.unwrap().of_type(method.data_type, 5), -3);
    let (other, _) = eds("[DeviceCommissioning]\nNodeID=7\n[1000]\nDataType=7\nAccessType=ro\n");
    assert_eq!(other.node_id, Some(7));
}

#[test]
fn domains_strings_and_types_without_limits() {
    let (eds, problems) = eds("[1F50]\nParameterName=Program\nObjectType=8\nSubNumber=2\n\
        [1F50sub1]\nParameterName=Program 1\nObjectType=2\n\
        [1008]\nParameterName=Name\nDataType=9\nAccessType=const\nDefaultValue=7 of 9\nLowLimit=\n\
        [2000]\nParameterName=Real\nDataType=8\nAccessType=rw\nDefaultValue=1.5e3\nHighLimit=2.5\n\
        [2001]\nParameterName=Own\nDataType=0x0040\nAccessType=ro\n");
    assert!(problems.is_empty(), "{problems:?}");
    let program = &eds.objects[&0x1F50].entries[&1];
    assert_eq!(
        (program.data_type, program.access),
        (DataType::Domain, Access::ReadWrite)
    );
    assert_eq!(eds.objects[&0x1008].entries[&0].default_text, "7 of 9");
    assert_eq!(eds.objects[&0x2000].entries[&0].default_text, "1.5e3");
    assert_eq!(
        eds.objects[&0x2001].entries[&0].data_type,
        DataType::Other(0x40)
    );
}

#[test]
fn sections_that_are_no_objects_are_left_alone() {
    let (eds, problems) = eds("[Comments]\nLines=1\nLine1=[6040] is not here\n\
        [DynamicChannels]\nNrOfSeg=0\n[StandardDataTypes]\n0x0001=1\n\
        [10000]\n[100]\n[60G0]\n[1000subXY]\n[1000sub+1]\n\
        [1000]\nParameterName=Device type\nDataType=0x0007\nAccessType=ro\n");
    assert!(problems.is_empty(), "{problems:?}");
    assert_eq!(eds.objects.keys().copied().collect::<Vec<_>>(), [0x1000]);
    assert_eq!(eds.objects[&0x1000].entries.len(), 1);
}

#[test]
fn dummies_may_be_mapped() {
    let (eds, _) = eds("[DummyUsage]\nDummy0001=0\nDummy0005=1\nDummy0006=0x1\n\
        [1000]\nDataType=7\nAccessType=ro\n");
    assert_eq!(eds.dummies, [5, 6]);
}
