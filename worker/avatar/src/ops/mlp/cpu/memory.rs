//! Memory for tiles and packed parameters, from a cache line's start on: vectors that straddle
//! two lines are read at half the speed.

use std::cell::Cell;

/// A cache line.
#[repr(align(64))]
#[derive(Clone, Copy)]
#[allow(dead_code)] // read and written as words
struct Line([u32; LINE]);

/// Words of a cache line.
const LINE: usize = 16;

/// 32-bit words, or f32.
#[derive(Default)]
pub struct Words {
    lines: Vec<Line>,
    len: usize,
}

impl Words {
    /// `len` words of 0.
    pub fn zeroed(len: usize) -> Self {
        Self {
            lines: vec![Line([0; LINE]); len.div_ceil(LINE)],
            len,
        }
    }

    /// At least `len` words of whatever stood there.
    fn at_least(&mut self, len: usize) {
        if self.lines.len() * LINE < len {
            self.lines.resize(len.div_ceil(LINE), Line([0; LINE]));
        }
        self.len = self.lines.len() * LINE;
    }

    /// All words.
    pub fn words(&mut self) -> &mut [u32] {
        // SAFETY: the lines are `len` words or more, one after the other, and borrowed alone.
        unsafe { std::slice::from_raw_parts_mut(self.lines.as_mut_ptr().cast(), self.len) }
    }

    /// All words, as numbers.
    pub fn floats(&mut self) -> &mut [f32] {
        // SAFETY: as in `words`; each pattern of bits is an f32.
        unsafe { std::slice::from_raw_parts_mut(self.lines.as_mut_ptr().cast(), self.len) }
    }

    /// All words, to read.
    pub fn read(&self) -> &[u32] {
        // SAFETY: as in `words`, borrowed for reading.
        unsafe { std::slice::from_raw_parts(self.lines.as_ptr().cast(), self.len) }
    }

    /// All words, to read as numbers.
    pub fn read_floats(&self) -> &[f32] {
        // SAFETY: as in `read`; each pattern of bits is an f32.
        unsafe { std::slice::from_raw_parts(self.lines.as_ptr().cast(), self.len) }
    }
}

thread_local! {
    static SCRATCH: Cell<Words> = const { Cell::new(Words { lines: Vec::new(), len: 0 }) };
}

/// Calls `run` with at least `len` words of this thread's, which hold anything. They are kept
/// for the next call: asking the system for a tile's memory anew costs as much as a small
/// network's tile.
pub fn with_scratch<R>(len: usize, run: impl FnOnce(&mut [u32]) -> R) -> R {
    let mut words = SCRATCH.take();
    words.at_least(len);
    let result = run(words.words());
    SCRATCH.set(words);
    result
}
