//! Memory for tiles and packed parameters, aligned to cache lines: vectors that straddle two lines
//! are read at half the speed.

use std::cell::Cell;
use std::marker::PhantomData;
use std::ops::Range;

/// A cache line.
#[repr(align(64))]
#[derive(Clone, Copy)]
#[allow(dead_code)] // Read and written as words.
struct Line([u32; LINE]);

/// Words of a cache line.
const LINE: usize = 16;

/// 32-bit words, or f32.
#[derive(Default)]
pub(super) struct Words {
    lines: Vec<Line>,
    len: usize,
}

impl Words {
    /// `len` words of 0.
    pub(super) fn zeroed(len: usize) -> Self {
        Self {
            lines: vec![Line([0; LINE]); len.div_ceil(LINE)],
            len,
        }
    }

    /// Makes room for at least `len` words, which keep their values or are 0.
    fn at_least(&mut self, len: usize) {
        if self.lines.len() * LINE < len {
            self.lines.resize(len.div_ceil(LINE), Line([0; LINE]));
        }
        self.len = self.lines.len() * LINE;
    }

    /// All words, to write.
    pub(super) fn words(&mut self) -> &mut [u32] {
        // SAFETY: the lines are `len` words or more, one after the other, and borrowed mutably.
        unsafe { std::slice::from_raw_parts_mut(self.lines.as_mut_ptr().cast(), self.len) }
    }

    /// All words, to write as numbers.
    pub(super) fn floats(&mut self) -> &mut [f32] {
        // SAFETY: as in `words`; each pattern of bits is a valid f32.
        unsafe { std::slice::from_raw_parts_mut(self.lines.as_mut_ptr().cast(), self.len) }
    }

    /// All words, to read.
    pub(super) fn read(&self) -> &[u32] {
        // SAFETY: the lines are `len` words or more, one after the other, and borrowed.
        unsafe { std::slice::from_raw_parts(self.lines.as_ptr().cast(), self.len) }
    }

    /// All words, to read as numbers.
    pub(super) fn read_floats(&self) -> &[f32] {
        // SAFETY: as in `read`; each pattern of bits is a valid f32.
        unsafe { std::slice::from_raw_parts(self.lines.as_ptr().cast(), self.len) }
    }
}

/// A mutable borrow of memory for the kernels, which read and write different parts of it at once.
///
/// All pointers into the memory are derived from one base pointer. A reborrow of the slice for a
/// second pointer would invalidate the first one under Rust's aliasing rules (Stacked Borrows),
/// even where the two never meet.
pub(super) struct Region<'a, T> {
    base: *mut T,
    len: usize,
    borrow: PhantomData<&'a mut [T]>,
}

impl<'a, T> Region<'a, T> {
    /// The memory of `slice`.
    pub(super) fn new(slice: &'a mut [T]) -> Self {
        Self {
            base: slice.as_mut_ptr(),
            len: slice.len(),
            borrow: PhantomData,
        }
    }

    /// A pointer to the memory from index `first` on. It stays valid as long as the region is
    /// borrowed, but must not be used while a slice from [`Region::floats`] or
    /// [`Region::read_floats`] lives.
    ///
    /// # Panics
    /// If `first` is past the end.
    pub(super) fn at(&self, first: usize) -> *mut T {
        assert!(first <= self.len, "{first} is past {} words", self.len);
        // SAFETY: within the memory or one past its end.
        unsafe { self.base.add(first) }
    }
}

impl Region<'_, u32> {
    /// Some of the words, to write as numbers.
    ///
    /// # Panics
    /// If the range is past the end.
    pub(super) fn floats(&mut self, range: Range<usize>) -> &mut [f32] {
        assert!(range.start <= range.end && range.end <= self.len);
        // SAFETY: words of the region, which `self` borrows mutably; an f32 has the size and the
        // alignment of a word, and each pattern of bits is a valid one.
        unsafe { std::slice::from_raw_parts_mut(self.at(range.start).cast(), range.len()) }
    }

    /// Some of the words, to read as numbers.
    ///
    /// # Panics
    /// If the range is past the end.
    pub(super) fn read_floats(&self, range: Range<usize>) -> &[f32] {
        assert!(range.start <= range.end && range.end <= self.len);
        // SAFETY: as in `floats`, borrowed for reading.
        unsafe { std::slice::from_raw_parts(self.at(range.start).cast(), range.len()) }
    }
}

thread_local! {
    static SCRATCH: Cell<Words> = const { Cell::new(Words { lines: Vec::new(), len: 0 }) };
}

/// Calls `run` with at least `len` words of this thread, whose values are arbitrary. They are kept
/// for the next call: a new allocation for each tile takes as long as a small network's tile.
pub(super) fn with_scratch<R>(len: usize, run: impl FnOnce(&mut [u32]) -> R) -> R {
    let mut words = SCRATCH.take();
    words.at_least(len);
    let result = run(words.words());
    SCRATCH.set(words);
    result
}
