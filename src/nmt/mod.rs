//! Network management: commands, states, error control (CiA 301, 7.2.8, 7.3.2).

mod command;
mod consumer;
mod error_behaviour;
mod error_control;
mod guarding;
mod node;
mod producer;
mod state;

pub use command::{Command, NodeControl, Target};
pub use consumer::{Consumer, Heard, Lost};
pub use error_behaviour::ErrorBehaviour;
pub use error_control::ErrorControl;
pub use guarding::{Guard, Guarded, Guardian, LifeGuarding};
pub use node::{Node, NodeEvent};
pub use producer::Producer;
pub use state::{Service, State};
