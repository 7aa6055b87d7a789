//! Work spread over the cores, results in the order of the work.

use std::num::NonZero;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::thread;

/// How many runs at a time this machine is good for.
pub(super) fn cores() -> usize {
    thread::available_parallelism().map_or(1, NonZero::get)
}

/// Does all `jobs` with `workers` threads. `done` is told of each result as it
/// comes in.
pub(super) fn run<J: Sync, R: Send>(
    jobs: &[J],
    workers: usize,
    work: impl Fn(&J) -> R + Sync,
    mut done: impl FnMut(&R),
) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let (results, incoming) = mpsc::channel();
    let (next, work) = (&next, &work);
    let mut all: Vec<(usize, R)> = thread::scope(|scope| {
        for _ in 0..workers.clamp(1, jobs.len().max(1)) {
            let results = results.clone();
            scope.spawn(move || {
                while let Some((place, job)) = take(jobs, next) {
                    // The receiver lives as long as this scope.
                    let _ = results.send((place, work(job)));
                }
            });
        }
        drop(results);
        incoming
            .iter()
            .inspect(|(_, result)| done(result))
            .collect()
    });
    all.sort_by_key(|(place, _)| *place);
    all.into_iter().map(|(_, result)| result).collect()
}

fn take<'j, J>(jobs: &'j [J], next: &AtomicUsize) -> Option<(usize, &'j J)> {
    let place = next.fetch_add(1, Ordering::Relaxed);
    jobs.get(place).map(|job| (place, job))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_keep_the_order_of_the_jobs() {
        let jobs: Vec<u32> = (0..100).collect();
        for workers in [1, 3, 1000] {
            let mut seen = 0;
            let squares = run(&jobs, workers, |n| n * n, |_| seen += 1);
            assert_eq!(squares, jobs.iter().map(|n| n * n).collect::<Vec<_>>());
            assert_eq!(seen, 100);
        }
        assert!(run(&[], 4, |n: &u32| *n, |_| ()).is_empty());
    }
}
