//! Tables, each with a separate scroll bar on a narrow page.

use maud::{Markup, html};

/// Table with a caption; the first column of `rows` is the header of its row, and numeric columns
/// are aligned right.
pub struct Table<'a> {
    pub caption: &'a str,
    /// Header; empty if the rows need none.
    pub header: &'a [&'a str],
    /// Index of the first column of numbers.
    pub numbers_from: usize,
    pub rows: Vec<Vec<String>>,
}

/// Returns numbers with the sign − instead of a hyphen.
fn minus(cell: &str) -> String {
    let mut text = String::with_capacity(cell.len());
    let mut characters = cell.chars().peekable();
    while let Some(c) = characters.next() {
        let is_sign = text.chars().last().is_none_or(|before| " e".contains(before))
            && characters.peek().is_some_and(char::is_ascii_digit);
        text.push(if c == '-' && is_sign { '−' } else { c });
    }
    text
}

impl Table<'_> {
    pub fn html(&self) -> Markup {
        self.html_with_class(self.header.is_empty().then_some("facts"), &[])
    }

    /// Returns the table with headers that sort it.
    pub fn sortable(&self) -> Markup {
        self.html_with_class(Some("sort"), &[])
    }

    /// Returns a sortable table in which rows can be chosen by category; `categories` has one
    /// category for each row.
    #[cfg(feature = "parquet")]
    pub fn html_with_categories(&self, categories: &[String]) -> Markup {
        self.html_with_class(Some("sort"), categories)
    }

    fn html_with_class(&self, table: Option<&str>, categories: &[String]) -> Markup {
        let class = |column: usize| (column >= self.numbers_from).then_some("number");
        html! {
            // The table can be focused, so that it can be scrolled without a mouse.
            div.scroll role="region" tabindex="0" aria-label=(self.caption) {
                table class=[table] {
                    caption { (self.caption) }
                    @if !self.header.is_empty() { thead { tr {
                        @for (column, name) in self.header.iter().enumerate() {
                            th scope="col" class=[class(column)] { (name) }
                        }
                    } } }
                    tbody {
                        @for (at, row) in self.rows.iter().enumerate() { tr data-category=[categories.get(at)] {
                            @for (column, cell) in row.iter().enumerate() {
                                @if column == 0 { th scope="row" { (cell) } }
                                @else if column >= self.numbers_from { td.number { (minus(cell)) } }
                                @else { td { (cell) } }
                            }
                        } }
                    }
                }
            }
        }
    }
}
