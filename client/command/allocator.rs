//! The allocator of the `yoto` command.
//!
//! A step asks for tensors of hundreds of megabytes and gives them back. An allocator that hands
//! such memory to the kernel at once has its pages cleared again each time: a quarter of a
//! training step at the paper's sizes. So the process keeps freed memory while a job runs, and gives it
//! back after the job: a large picture would otherwise occupy a server for good.

use libmimalloc_sys::{mi_collect, mi_option_set, mi_option_t};

/// `mi_option_purge_delay` of mimalloc's header, for which its bindings have no name.
const PURGE_DELAY: mi_option_t = 15;
/// Milliseconds until freed memory returns to the kernel by itself; ten times as many for blocks of many
/// megabytes. With -1 it would never return, not even by [`give_back_memory`].
const MINUTE: std::ffi::c_long = 60_000;

/// Makes mimalloc keep freed memory, unless `MIMALLOC_PURGE_DELAY` is set.
pub fn keep_freed_memory() {
    if std::env::var_os("MIMALLOC_PURGE_DELAY").is_none() {
        // SAFETY: sets a number in mimalloc's table of options, which may be done at any time; the
        // index is inside that table.
        unsafe { mi_option_set(PURGE_DELAY, MINUTE) };
    }
}

/// Gives freed memory back to the kernel.
pub fn give_back_memory() {
    // SAFETY: takes no pointer; mimalloc's heaps are initialised before any code of this program runs,
    // and any thread may ask for it at any time.
    unsafe { mi_collect(true) };
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;
    use std::alloc::{GlobalAlloc, Layout};

    const BYTES: usize = 256 << 20;

    /// Bytes of this process that are in memory.
    fn resident() -> usize {
        let pages = std::fs::read_to_string("/proc/self/statm").expect("Linux tells");
        let pages = pages
            .split(' ')
            .nth(1)
            .and_then(|it| it.parse::<usize>().ok());
        4096 * pages.expect("the second number")
    }

    /// Takes memory from mimalloc, fills it, and gives it back.
    fn fill_and_free() {
        let layout = Layout::from_size_align(BYTES, 64).expect("a layout");
        // SAFETY: the layout is not empty; what was allocated is written inside its bounds and
        // freed once, with the same layout.
        unsafe {
            let block = mimalloc::MiMalloc.alloc(layout);
            assert!(!block.is_null());
            std::ptr::write_bytes(block, 1, BYTES);
            std::hint::black_box(block);
            mimalloc::MiMalloc.dealloc(block, layout);
        }
    }

    /// Set in the process that runs the test alone.
    const ALONE: &str = "YOTO_TEST_ALLOCATOR";

    /// Runs in a process of its own: other tests take memory meanwhile.
    #[test]
    fn freed_memory_stays_with_the_process_until_it_is_given_back() {
        if std::env::var_os(ALONE).is_some() {
            return check_freed_memory();
        }
        let name = concat!(
            "allocator::tests::",
            "freed_memory_stays_with_the_process_until_it_is_given_back"
        );
        let tests = std::env::current_exe().expect("this program");
        let mut alone = std::process::Command::new(tests);
        alone.args(["--exact", name, "--nocapture"]).env(ALONE, "1");
        let out = alone.output().expect("runs");
        let said = String::from_utf8_lossy(&out.stdout);
        assert!(out.status.success(), "{said}");
        assert!(said.contains("1 passed"), "{said}");
    }

    fn check_freed_memory() {
        // SAFETY: as in `keep_freed_memory`. No delay: what is freed goes back at once.
        unsafe { mi_option_set(PURGE_DELAY, 0) };
        let before = resident();
        fill_and_free();
        let given_back = resident();
        assert!(
            given_back < before + BYTES / 2,
            "{before} bytes, {given_back} after giving back: the option is another"
        );
        keep_freed_memory();
        fill_and_free();
        assert!(resident() > given_back + BYTES / 2);
        give_back_memory();
        let left = resident();
        assert!(left < given_back + BYTES / 4, "{left} bytes stay");
    }
}
