//! Faults that can be asked for on the command line.

use std::str::FromStr;

use canmaster::NodeId;
use canmaster::network::{self, Network, Node};
use canmaster_sim::world::{Ailment, Scenario};

/// `NODE:identity`, `NODE:refuse=INDEX[:SUB]`, `NODE:forgetful`, `NODE:silent`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Fault {
    node: NodeId,
    ailment: Ailment,
}

impl Fault {
    /// Whether a drive of the network can have it; if not, why.
    pub(crate) fn check(self, network: &'static Network) -> Result<(), String> {
        let id = self.node.get();
        let Some((_, node)) = network.find(self.node) else {
            return Err(format!("the network has no node {id}"));
        };
        if let Ailment::RefusesWrite { index, sub } = self.ailment
            && !is_written(network, node, index, sub)
        {
            return Err(format!(
                "the configuration of node {id} does not write {index:04X}h:{sub:02X}, so it cannot be refused"
            ));
        }
        Ok(())
    }

    /// The scenario with this fault.
    pub(crate) fn apply(self, scenario: Scenario) -> Scenario {
        scenario.ailing(self.node, self.ailment)
    }
}

const HELP: &str =
    "expected NODE:identity, NODE:refuse=INDEX[:SUB] in hex, NODE:forgetful, or NODE:silent";

impl FromStr for Fault {
    type Err = String;

    fn from_str(text: &str) -> Result<Fault, String> {
        let (node, what) = text.split_once(':').ok_or(HELP)?;
        let node = crate::cli::node(node)?;
        let ailment = match what.split_once('=') {
            None if what == "identity" => Ailment::WrongIdentity,
            None if what == "forgetful" => Ailment::Forgetful,
            None if what == "silent" => Ailment::SilentInMotion,
            Some(("refuse", object)) => {
                let (index, sub) = object.split_once(':').unwrap_or((object, "0"));
                let index = u16::from_str_radix(index, 16).map_err(|_| HELP)?;
                let sub = u8::from_str_radix(sub, 16).map_err(|_| HELP)?;
                Ailment::RefusesWrite { index, sub }
            }
            _ => return Err(HELP.into()),
        };
        Ok(Fault { node, ailment })
    }
}

/// Whether the master's configuration of a node writes this object.
fn is_written(network: &'static Network, node: &'static Node, index: u16, sub: u8) -> bool {
    network::plan(network, node).any(|write| (write.at.index.0, write.at.sub.0) == (index, sub))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_read() {
        let node = NodeId::constant::<3>();
        let read = |text: &str| text.parse::<Fault>();
        let fault = |ailment| Ok(Fault { node, ailment });
        assert_eq!(read("3:identity"), fault(Ailment::WrongIdentity));
        assert_eq!(read("3:forgetful"), fault(Ailment::Forgetful));
        assert_eq!(read("3:silent"), fault(Ailment::SilentInMotion));
        let refuses = |index, sub| fault(Ailment::RefusesWrite { index, sub });
        assert_eq!(read("3:refuse=6085"), refuses(0x6085, 0));
        assert_eq!(read("3:refuse=1016:1"), refuses(0x1016, 1));
        for bad in [
            "",
            "3",
            "3:loud",
            "3:refuse",
            "3:refuse=xyz",
            "3:refuse=10000",
            "identity",
        ] {
            assert!(read(bad).is_err(), "{bad}");
        }
        for unfit in ["9:silent", "3:refuse=1000", "3:refuse=60C2"] {
            let network = canmaster_sim::world::sample().network();
            assert!(read(unfit).unwrap().check(network).is_err(), "{unfit}");
            assert_eq!(read("3:refuse=6085").unwrap().check(network), Ok(()));
        }
    }
}
