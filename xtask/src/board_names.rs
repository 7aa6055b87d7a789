//! The names of the board's objects: they are in the EDS and nowhere in flash.

use canmaster_network::model::{Machine, Node};

/// What an object is called that is not in the list.
pub(crate) const NAMELESS: &str = "Object without a name";

/// The names of an object's entries after sub-index 0.
enum Subs {
    /// A variable.
    None,
    /// One by one.
    Named(&'static [&'static str]),
    /// So and a number.
    Numbered(&'static str),
    /// One for each node-ID.
    PerNode,
    /// One for each axis.
    PerAxis,
    /// The process data of a node.
    Process,
}

/// Objects from the first index on, as many as `count`, with their name; where
/// there are several, their number or node-ID follows it.
struct Row {
    first: u16,
    count: u16,
    /// The number of the first.
    number: u16,
    name: &'static str,
    subs: Subs,
}

const fn row(first: u16, name: &'static str, subs: Subs) -> Row {
    rows(first, 1, 0, name, subs)
}

const fn rows(first: u16, count: u16, number: u16, name: &'static str, subs: Subs) -> Row {
    Row {
        first,
        count,
        number,
        name,
        subs,
    }
}

/// Objects of one kind of PDO parameters.
const PDOS: u16 = 0x200;
/// Node-IDs and 0, which is none.
const IDS: u16 = 0x80;
const PDO: Subs = Subs::Named(&["COB-ID", "Transmission type"]);
const NUMBER_OF_ENTRIES: &str = "Highest sub-index supported";

const ROWS: &[Row] = &[
    row(0x1000, "Device type", Subs::None),
    row(0x1001, "Error register", Subs::None),
    row(0x1002, "Manufacturer status register", Subs::None),
    row(
        0x1003,
        "Pre-defined error field",
        Subs::Numbered("Standard error field"),
    ),
    row(0x1005, "COB-ID SYNC message", Subs::None),
    row(0x1006, "Communication cycle period", Subs::None),
    row(0x1007, "Synchronous window length", Subs::None),
    row(0x1008, "Manufacturer device name", Subs::None),
    row(0x1009, "Manufacturer hardware version", Subs::None),
    row(0x100A, "Manufacturer software version", Subs::None),
    row(
        0x1010,
        "Store parameters",
        Subs::Named(&["Save all parameters"]),
    ),
    row(
        0x1011,
        "Restore default parameters",
        Subs::Named(&["Restore all default parameters"]),
    ),
    row(0x1012, "COB-ID time stamp object", Subs::None),
    row(0x1014, "COB-ID EMCY", Subs::None),
    row(0x1015, "Inhibit time EMCY", Subs::None),
    row(
        0x1016,
        "Consumer heartbeat time",
        Subs::Numbered("Consumer heartbeat time"),
    ),
    row(0x1017, "Producer heartbeat time", Subs::None),
    row(
        0x1018,
        "Identity object",
        Subs::Named(&[
            "Vendor-ID",
            "Product code",
            "Revision number",
            "Serial number",
        ]),
    ),
    row(0x1019, "Synchronous counter overflow value", Subs::None),
    row(
        0x1020,
        "Verify configuration",
        Subs::Named(&["Configuration date", "Configuration time"]),
    ),
    row(0x1028, "Emergency consumer", Subs::PerNode),
    row(
        0x1029,
        "Error behaviour",
        Subs::Named(&["Communication error"]),
    ),
    row(
        0x1200,
        "SDO server parameter",
        Subs::Named(&["COB-ID client to server", "COB-ID server to client"]),
    ),
    rows(
        0x1280,
        IDS,
        1,
        "SDO client parameter",
        Subs::Named(&[
            "COB-ID client to server",
            "COB-ID server to client",
            "Node-ID of the server",
        ]),
    ),
    rows(0x1400, PDOS, 1, "RPDO communication parameter", PDO),
    rows(
        0x1600,
        PDOS,
        1,
        "RPDO mapping parameter",
        Subs::Numbered("Mapped object"),
    ),
    rows(0x1800, PDOS, 1, "TPDO communication parameter", PDO),
    rows(
        0x1A00,
        PDOS,
        1,
        "TPDO mapping parameter",
        Subs::Numbered("Mapped object"),
    ),
    row(0x1F22, "Concise DCF", Subs::PerNode),
    row(0x1F25, "Configure slave", Subs::PerNode),
    row(0x1F26, "Expected configuration date", Subs::PerNode),
    row(0x1F27, "Expected configuration time", Subs::PerNode),
    row(0x1F80, "NMT start-up", Subs::None),
    row(0x1F81, "NMT slave assignment", Subs::PerNode),
    row(0x1F82, "Request NMT", Subs::PerNode),
    row(0x1F84, "Device type identification", Subs::PerNode),
    row(0x1F85, "Vendor identification", Subs::PerNode),
    row(0x1F86, "Product code identification", Subs::PerNode),
    row(0x1F87, "Revision number identification", Subs::PerNode),
    row(0x1F88, "Serial number identification", Subs::PerNode),
    row(0x1F89, "Boot time", Subs::None),
    row(0x1F8A, "Restore configuration", Subs::PerNode),
    row(0x2000, "Group command", Subs::None),
    row(0x2001, "Group state", Subs::None),
    row(0x2002, "Last refusal", Subs::None),
    row(0x2003, "Axes of the command", Subs::None),
    row(0x2004, "Target position", Subs::PerAxis),
    row(0x2005, "Profile velocity", Subs::PerAxis),
    row(0x2006, "Profile acceleration", Subs::PerAxis),
    row(0x2007, "Profile jerk", Subs::None),
    row(0x2008, "Mode of operation", Subs::PerAxis),
    row(0x2009, "Actual position", Subs::PerAxis),
    row(0x200A, "Actual velocity", Subs::PerAxis),
    row(0x200B, "Reference position", Subs::PerAxis),
    row(0x200C, "Following error", Subs::PerAxis),
    row(0x200D, "Statusword", Subs::PerAxis),
    row(0x200E, "Fault", Subs::PerAxis),
    row(0x200F, "Program", Subs::None),
    row(0x2010, "Program step", Subs::None),
    row(0x2F00, "Boot status, letter", Subs::PerNode),
    row(0x2F01, "Boot status in words", Subs::PerNode),
    row(0x2F02, "Newest emergency in words", Subs::PerNode),
    row(0x2F10, "Clock of the master", Subs::None),
    row(0x2F11, "Period of TIME", Subs::None),
    row(
        0x2F12,
        "Transfer test",
        Subs::Named(&[
            "Entry of a node",
            "Bytes",
            "Seed of the data",
            "Start",
            "Bytes transferred",
            "Time in microseconds",
            "Result",
        ]),
    ),
    row(
        0x2F20,
        "Measured",
        Subs::Named(&[
            "SYNC jitter in microseconds",
            "Latest SYNC after its tick in microseconds",
            "Longest cycle in microseconds",
            "Longest sync_tick in cycles",
            "Longest can_irq in cycles",
            "Longest pdo_producer in cycles",
            "Longest network in cycles",
            "Greatest bus load per mille",
            "CPU load per mille",
            "Overruns",
            "RPDOs late",
            "SYNCs not sent",
            "Answers to background requests",
        ]),
    ),
    rows(
        0x2F80,
        IDS,
        0,
        "Emergencies of node",
        Subs::Numbered("Emergency"),
    ),
    rows(0x3000, IDS, 0, "Process data of node", Subs::Process),
];

/// The names of one object and its entries.
pub(crate) struct Names<'a> {
    row: Option<&'static Row>,
    index: u16,
    /// The nodes of the bus.
    nodes: Vec<&'a Node>,
}

impl<'a> Names<'a> {
    pub(crate) fn new(index: u16, machine: &'a Machine, bus: usize) -> Names<'a> {
        let within = |row: &&Row| (row.first..row.first + row.count).contains(&index);
        Names {
            row: ROWS.iter().find(within),
            index,
            nodes: machine
                .nodes
                .iter()
                .filter(|node| node.bus == bus)
                .collect(),
        }
    }

    pub(crate) fn object(&self) -> String {
        match self.row {
            None => NAMELESS.to_string(),
            Some(row) if row.count == 1 => row.name.to_string(),
            Some(row) => format!("{} {}", row.name, self.index - row.first + row.number),
        }
    }

    pub(crate) fn entry(&self, sub: u8) -> String {
        let Some(row) = self.row else {
            return self.object();
        };
        let n = usize::from(sub);
        match &row.subs {
            Subs::None => self.object(),
            _ if sub == 0 => NUMBER_OF_ENTRIES.to_string(),
            Subs::Named(names) => names.get(n - 1).copied().unwrap_or_default().to_string(),
            Subs::Numbered(name) => format!("{name} {sub}"),
            Subs::PerNode => match self.nodes.iter().find(|node| node.id == sub) {
                Some(node) => format!("Node {sub}, {}", node.name),
                None => "All nodes".to_string(),
            },
            Subs::PerAxis => format!("Axis {sub}"),
            Subs::Process => self.process(n - 1),
        }
    }

    /// The field `n` of the process image: what the node sends comes first.
    fn process(&self, n: usize) -> String {
        let id = self.index % IDS;
        let node = self.nodes.iter().find(|node| u16::from(node.id) == id);
        let fields = node.into_iter().flat_map(|node| {
            let pdos = node.tpdos.iter().chain(&node.rpdos);
            pdos.flat_map(|pdo| &pdo.mapping)
        });
        let mut names: Vec<String> = Vec::new();
        for field in fields {
            // One that is in two PDOs is in the record twice.
            let name = match names.contains(&field.name) {
                true => format!("{} {}", field.name, names.len() + 1),
                false => field.name.clone(),
            };
            names.push(name);
        }
        names.into_iter().nth(n).unwrap_or_default()
    }
}
