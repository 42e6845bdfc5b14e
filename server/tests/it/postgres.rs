//! PostgreSQL: all tests of this program again, and what only it does.

use crate::support::{ON_POSTGRES, ON_S3};
use std::process::Command;
use yoto_test_postgres::Database;

#[test]
fn all_of_this_holds_on_postgres_too() {
    let again = [ON_POSTGRES, ON_S3]
        .iter()
        .any(|it| std::env::var_os(it).is_some());
    if again || Database::create().is_none() {
        return;
    }
    let program = std::env::current_exe().expect("this program");
    let ran = Command::new(program)
        .env(ON_POSTGRES, "1")
        .output()
        .expect("starts");
    let said = String::from_utf8_lossy(&ran.stdout);
    assert!(ran.status.success(), "{said}");
    assert!(said.contains("test result: ok"), "{said}");
}
