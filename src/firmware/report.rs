//! How `network` hands on what it has to say.

use crate::{control::Control, counters::Count, log::News, wake};
use canmaster::master::Report;
use heapless::spsc::Producer;

/// Hands a report to the log, and a fault to the group.
pub(crate) fn tell(
    report: Report,
    news: &mut Producer<'static, News>,
    control: &mut impl rtic::Mutex<T = Control>,
) {
    if let (Some(axis), Some(cause)) = (report.axis, report.fault()) {
        control.lock(|control| control.tell_fault(axis.into(), cause));
    }
    publish(news, News::Node(report));
}

/// Hands something to the log.
pub(crate) fn publish(to: &mut Producer<'static, News>, news: News) {
    if to.enqueue(news).is_err() {
        Count::LogFull.add(1);
    }
    wake::want();
}
