//! The `yoto` command, implemented in [`yoto_client::commands`].

use std::process::ExitCode;

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    yoto_client::allocator::keep_freed_memory();
    yoto_client::commands::main()
}
