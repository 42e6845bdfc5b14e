//! The `yoto` command, built as part of this package so that tests find the binary that was
//! built with them.

use std::process::ExitCode;

fn main() -> ExitCode {
    yoto::cli::main()
}
