//! The newest of what happened.

use heapless::Deque;

/// The newest `N` of what was put in, as 1003h has its errors
/// (CiA 301, 7.5.2.4).
#[derive(Clone, Debug)]
pub struct History<T, const N: usize>(Deque<T, N>);

impl<T, const N: usize> History<T, N> {
    /// Nothing happened yet.
    pub const fn new() -> History<T, N> {
        History(Deque::new())
    }

    /// Puts in the newest; the oldest goes where there is no room.
    pub fn push(&mut self, item: T) {
        if self.0.is_full() {
            self.0.pop_back();
        }
        // There is room now, unless there never is.
        let _ = self.0.push_front(item);
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The newest is 0.
    pub fn get(&self, age: usize) -> Option<&T> {
        self.0.iter().nth(age)
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.0.clear();
    }
}

impl<T, const N: usize> Default for History<T, N> {
    fn default() -> History<T, N> {
        History::new()
    }
}
