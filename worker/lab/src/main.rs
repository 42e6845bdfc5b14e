//! The `yoto-lab` command, implemented in [`yoto_lab::commands`].

use std::process::ExitCode;
use yoto_lab::commands;

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    keep_freed_memory();
    commands::main()
}

/// Makes mimalloc keep freed memory for a minute, as the `yoto` command does: a step asks for the
/// same hundreds of megabytes again and again, and the kernel would clear their pages each time.
fn keep_freed_memory() {
    /// `mi_option_purge_delay` of mimalloc's header, for which its bindings have no name.
    const PURGE_DELAY: libmimalloc_sys::mi_option_t = 15;
    /// Milliseconds.
    const MINUTE: std::ffi::c_long = 60_000;
    if std::env::var_os("MIMALLOC_PURGE_DELAY").is_none() {
        // SAFETY: sets a number in mimalloc's table of options, which may be done at any time; the
        // index is inside that table.
        unsafe { libmimalloc_sys::mi_option_set(PURGE_DELAY, MINUTE) };
    }
}
