"""The report of a run: one HTML page that needs no network, made from the files of the run alone.

``write_report`` is where to begin: it puts the ``sections`` on a page. ``html`` makes elements, ``chart`` curves, ``charts``
chooses them from the columns of a history, ``methods`` is the text for a publication, ``pictures`` what the page embeds.
``page.css`` and ``page.js`` go into it whole.
"""
