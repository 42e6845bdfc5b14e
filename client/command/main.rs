//! The `yoto` command, implemented in [`yoto::cli`].

use std::process::ExitCode;

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    yoto::allocator::keep_freed_memory();
    yoto::cli::main()
}
