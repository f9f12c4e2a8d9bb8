-- simulated joules per storey, method and number of queries: the mean over the seeds (Fig. 19)
select building, storey, series, n_queries, method,
       count(*) as seeds,
       round(avg(captures), 2) as captures,
       round(avg(rejected), 2) as rejected,
       round(avg(uploads), 2) as uploads,
       round(avg(unanswered), 2) as unanswered,
       round(avg(capture_j), 1) as capture_j,
       round(avg(process_j), 1) as process_j,
       round(avg(transmit_j), 1) as transmit_j,
       round(avg(total_j), 1) as total_j,
       round(avg(total_j) / nullif(n_queries - avg(unanswered), 0), 2) as j_per_answer
from energy
group by building, storey, series, n_queries, method
order by building, storey, series, n_queries, method
