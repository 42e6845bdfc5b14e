//! The `yoto` command. All of it stands in [`yoto_client::commands`].

use std::process::ExitCode;

fn main() -> ExitCode {
    yoto_client::commands::main()
}
