//! The newest of what happened.

/// The newest `N` of what was put in, as 1003h has its errors
/// (CiA 301, 7.5.2.4).
#[derive(Clone, Debug)]
pub struct History<T, const N: usize>([Option<T>; N]);

impl<T, const N: usize> History<T, N> {
    /// Nothing happened yet.
    pub const fn new() -> History<T, N> {
        History([const { None }; N])
    }

    /// Puts in the newest; the oldest goes where there is no room.
    pub fn push(&mut self, item: T) {
        let mut moved = Some(item);
        for place in &mut self.0 {
            core::mem::swap(place, &mut moved);
        }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.0.iter().flatten().count()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The newest is 0.
    pub fn get(&self, age: usize) -> Option<&T> {
        self.0.get(age)?.as_ref()
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.0.fill_with(|| None);
    }
}

impl<T, const N: usize> Default for History<T, N> {
    fn default() -> History<T, N> {
        History::new()
    }
}
