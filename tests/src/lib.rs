//! Workspace-wide integration tests.
