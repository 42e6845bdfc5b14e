//! The `yoto-lab` command, built as part of this package so that tests find the binary that was
//! built with them.

use std::process::ExitCode;

fn main() -> ExitCode {
    yoto_lab::commands::main()
}
