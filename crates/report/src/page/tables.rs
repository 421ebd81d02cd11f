//! Tables that scroll by themselves where the page is narrow.

use maud::{Markup, html};

/// A table under a caption; the first column of `rows` is the header of its row, `numeric` columns
/// stand to the right.
pub struct Table<'a> {
    pub caption: &'a str,
    /// Empty where the rows need none.
    pub header: &'a [&'a str],
    /// Columns from this one on are numbers.
    pub numbers_from: usize,
    pub rows: Vec<Vec<String>>,
}

impl Table<'_> {
    pub fn html(&self) -> Markup {
        self.of_class(self.header.is_empty().then_some("facts"), &[])
    }

    /// The same with headers that sort it.
    pub fn sortable(&self) -> Markup {
        self.of_class(Some("sort"), &[])
    }

    /// A sortable table whose rows are of categories, one for each row, by which they can be chosen.
    #[cfg(feature = "parquet")]
    pub fn of_categories(&self, categories: &[String]) -> Markup {
        self.of_class(Some("sort"), categories)
    }

    fn of_class(&self, table: Option<&str>, categories: &[String]) -> Markup {
        let class = |column: usize| (column >= self.numbers_from).then_some("number");
        html! {
            // Reachable by keyboard, so that it can be scrolled without a mouse.
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
                                @else { td class=[class(column)] { (cell) } }
                            }
                        } }
                    }
                }
            }
        }
    }
}
